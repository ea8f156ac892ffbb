# Debian's ROS nodes start with "env python3" and need Debian's own Python. By default, ROS uses only loopback.
case "$PATH" in /usr/bin:*) ;; *) PATH="/usr/bin:$PATH"; export PATH ;; esac
if [ -z "${ROS_IP:-}" ] && [ -z "${ROS_HOSTNAME:-}" ]; then
  ROS_IP=127.0.0.1
  export ROS_IP
fi
export ROSCONSOLE_STDOUT_LINE_BUFFERED=1
