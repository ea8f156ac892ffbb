# Sourced by docker/test and docker/run: finds a container engine that really starts a container, and a Debian 12 base.
# Sets: engine_build (array), engine_run (array). Uses a registry only if the base image is neither present nor makeable.

say() { printf '[container] %s\n' "$*" >&2; }
die() { local status=$1; shift; say "error: $*"; exit "$status"; }

base=debian:bookworm
image=coglab:latest
# podman's defaults ask for more than some hosts' hard limits allow; these stay below them
limits=(--ulimit "nofile=$(ulimit -Hn):$(ulimit -Hn)" --ulimit nproc=30000:30000)

starts() { # starts COMMAND ... : whether this way of running starts a container of the base image
  "$@" run --rm --network none "${extra[@]}" "$base" true >/dev/null 2>&1
}

find_engine() {
  if command -v docker >/dev/null && timeout 10 docker info >/dev/null 2>&1; then
    engine=(docker)
    return
  fi
  command -v podman >/dev/null || die 69 "neither a docker daemon answers nor is podman installed; get one: apt-get install --no-install-recommends podman crun debootstrap"
  engine=(podman)
}

have_base() { "${engine[@]}" image inspect "$base" >/dev/null 2>&1 || "${engine[@]}" image inspect "localhost/$base" >/dev/null 2>&1; }

make_base() { # a minimal tree by debootstrap, with this machine's package sources
  command -v debootstrap >/dev/null || return 1
  [ "$(id -u)" = 0 ] || return 1
  local tree mirror
  tree=$(mktemp -d)
  mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 2>/dev/null | grep -v security | head -n1)
  [ -n "$mirror" ] || return 1
  say "making the base image with debootstrap ..."
  if debootstrap --variant=minbase bookworm "$tree" "$mirror" >"$tree.log" 2>&1; then
    rm -f "$tree"/etc/resolv.conf "$tree"/etc/hostname "$tree"/var/cache/apt/archives/*.deb
    tar -C "$tree" --numeric-owner -c . | "${engine[@]}" import - "$base" >/dev/null
  fi
  rm -rf "$tree"
  have_base
}

find_way() { # the first way in which podman starts a container here
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
    die 70 "no image $base: it is not here, debootstrap (as root) made none, and no registry gave one"
  find_way
  engine_build=("${engine[@]}" build)
  [ "${engine[0]}" = docker ] || engine_build+=(--isolation=chroot)
  engine_build+=(--network host -f "$top/docker/Dockerfile" -t "$image" "$top")
  engine_run=("${engine[@]}" run --rm "${extra[@]}")
}
