# Sourced by docker/test, docker/run and docker/prove_bare. Reads --suite bookworm|trixie (Debian 12 or 13) off their arguments.
# prepare_engine finds a container engine that can start a container, and a base image of that suite. It sets the arrays
# engine_build and engine_run. It uses a registry only if the base image is missing and cannot be made here.

say() { printf '[container] %s\n' "$*" >&2; }
die() { local status=$1; shift; say "error: $*"; exit "$status"; }

suite=bookworm
if [ "${1:-}" = --suite ]; then
  suite=${2:-}
  shift $(($# < 2 ? $# : 2))
fi
case $suite in bookworm | trixie) ;; *) die 2 "no suite named '$suite'; there are: bookworm trixie" ;; esac
base=debian:$suite
image=coglab:$suite
# some hosts' hard limits are lower than podman's defaults; these values are not
limits=(--ulimit "nofile=$(ulimit -Hn):$(ulimit -Hn)" --ulimit nproc=30000:30000)

starts() { # starts COMMAND ... : true if this command starts a container of the base image
  "$@" run --rm --network none "${extra[@]}" "$base" true >/dev/null 2>&1
}

find_engine() {
  if command -v docker >/dev/null && timeout 10 docker info >/dev/null 2>&1; then
    engine=(docker)
    return
  fi
  command -v podman >/dev/null || die 69 "no docker daemon answers and podman is not installed; install one: apt-get install --no-install-recommends podman crun debootstrap"
  engine=(podman)
}

have_base() { "${engine[@]}" image inspect "$base" >/dev/null 2>&1 || "${engine[@]}" image inspect "localhost/$base" >/dev/null 2>&1; }

make_tree() { # make_tree FOLDER: a minimal Debian of the suite, from this machine's mirror
  local mirror
  mirror=$({ apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Label: Debian' 2>/dev/null
    echo http://deb.debian.org/debian; } | sed -n 1p)
  debootstrap --variant=minbase "$suite" "$1" "$mirror" >"$1.log" 2>&1
}

make_base() {
  command -v debootstrap >/dev/null || return 1
  [ "$(id -u)" = 0 ] || return 1
  local tree
  tree=$(mktemp -d)
  say "making the base image with debootstrap ..."
  if make_tree "$tree"; then
    rm -f "$tree"/etc/resolv.conf "$tree"/etc/hostname "$tree"/var/cache/apt/archives/*.deb
    tar -C "$tree" --numeric-owner -c . | "${engine[@]}" import - "$base" >/dev/null
  fi
  rm -rf "$tree"
  have_base
}

find_way() { # finds the first command with which podman starts a container here
  extra=()
  if [ "${engine[0]}" = docker ] || starts "${engine[@]}"; then return; fi
  extra=("${limits[@]}")
  if starts "${engine[@]}"; then return; fi
  if command -v runc >/dev/null; then
    engine=(podman --runtime runc)
    if starts "${engine[@]}"; then return; fi
  fi
  # hybrid cgroups stop crun; without the second hierarchy in a private mount namespace it starts
  engine=(unshare --mount --propagation private sh -c 'umount /sys/fs/cgroup/unified 2>/dev/null; exec podman "$@"' podman)
  if starts "${engine[@]}"; then return; fi
  die 69 "podman is installed but starts no container here: $(podman run --rm --network none "$base" true 2>&1 | tail -n1)"
}

prepare_engine() {
  find_engine
  have_base || make_base || "${engine[@]}" pull "$base" >/dev/null ||
    die 70 "no image $base: it is missing, debootstrap (as root) could not make it, and no registry provided it"
  find_way
  engine_build=("${engine[@]}" build)
  [ "${engine[0]}" = docker ] || engine_build+=(--isolation=chroot)
  engine_build+=(--network host --build-arg "SUITE=$suite" -f "$top/docker/Dockerfile" -t "$image" "$top")
  engine_run=("${engine[@]}" run --rm "${extra[@]}")
}
