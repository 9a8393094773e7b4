#!/bin/sh
# Tries the two commands of the README on a bare Debian: makes a chroot of it, copies into it what is
# committed, and runs `make demo` and `make test` there, from nothing. Needs root and debootstrap.
#
#   sh scripts/try_on.sh SUITE                both commands; SUITE is bookworm, trixie, ...
#   sh scripts/try_on.sh SUITE make demo      one command, any
#   sh scripts/try_on.sh --again SUITE ...    in the chroot as the last trial left it
#
# The mirror is the one this machine's apt uses. Proxies, certificates and the settings of pip are
# those of this machine. The chroots lie in $TRY_ON, /var/tmp/fclib-try-on by default; the trial's
# stays to be looked into, with the commit in /fclib.
set -eu
again=false
if [ "${1-}" = --again ]; then
  again=true
  shift
fi
[ $# -ge 1 ] || { sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2; exit 2; }
suite=$1
shift
[ $# -gt 0 ] || set -- sh -c "make demo && make test"
source=$(cd "$(dirname "$0")/.." && pwd)
folder=${TRY_ON:-/var/tmp/fclib-try-on}
base=$folder/$suite.base
root=$folder/$suite

[ "$(id -u)" -eq 0 ] || { echo "a chroot needs root" >&2; exit 1; }
for tool in debootstrap git unshare; do
  command -v $tool >/dev/null || { echo "there is no $tool: apt-get install $tool" >&2; exit 1; }
done
mkdir -p "$folder"

if [ ! -e "$base/.done" ]; then
  # $(...) are words of apt's, not of this shell
  # shellcheck disable=SC2016
  mirror=$(apt-get indextargets --format '$(LABEL) $(REPO_URI)' 'Created-By: Packages' |
    sed -n 's/^Debian //p' | head -n 1)
  [ -n "$mirror" ] || { echo "apt has no mirror of Debian here; apt-get update finds it" >&2; exit 1; }
  echo "== $suite from $mirror, into $base"
  rm -rf "$base"
  # what the README takes for given: make, and certificates to download by
  debootstrap --variant=minbase --include=make,ca-certificates "$suite" "$base" "$mirror" \
    >"$folder/$suite.log" 2>&1 || { tail -n 20 "$folder/$suite.log" >&2; exit 1; }
  touch "$base/.done"
fi

if ! $again || [ ! -e "$root/.done" ]; then
  rm -rf "$root"
  cp -a "$base" "$root"
fi
mkdir -p "$root/fclib"
git -C "$source" archive HEAD | tar -x -C "$root/fclib"

# how this machine reaches what is outside: name servers, proxies, certificates, the settings of pip
cp /etc/resolv.conf /etc/hosts "$root/etc/"
apt-config dump | grep -E '^Acquire::([a-z]+::Proxy|Check-)' >"$root/etc/apt/apt.conf.d/90host" || true
[ ! -e /usr/local/share/ca-certificates ] ||
  cp -RL /usr/local/share/ca-certificates/. "$root/usr/local/share/ca-certificates/"
chroot "$root" update-ca-certificates >/dev/null 2>&1 || true
settings=$(env | sed -n 's/^\(\(PIP_[A-Z_]*\|[a-z]*_proxy\|[A-Z]*_PROXY\|[A-Z_]*_CA_BUNDLE\|SSL_CERT_[A-Z]*\)\)=.*/\1/p')
for name in $settings; do
  eval "set -- \"\$@\" \"$name=\$$name\""
done
# the settings go before the command: env NAME=VALUE... COMMAND...
count=$(($# - $(echo "$settings" | wc -w)))
while [ "$count" -gt 0 ]; do
  set -- "$@" "$1"
  shift
  count=$((count - 1))
done
same() { # same FILE: it is in the chroot too, at the same place
  [ ! -f "$1" ] || { mkdir -p "$root$(dirname "$1")" && cp -L "$1" "$root$1"; }
}
same /etc/pip.conf
same "$HOME/.config/pip/pip.conf"
same "$HOME/.pip/pip.conf"
for name in $settings; do
  eval "same \"\$$name\""
done
same "$(sed -n 's/^ *cert *= *//p' /etc/pip.conf "$HOME/.config/pip/pip.conf" 2>/dev/null | head -n 1)"

echo "== in $root/fclib, commit $(git -C "$source" rev-parse --short HEAD)"
# mounts and processes of the trial end with it
ROOT=$root exec unshare --mount --pid --fork sh -ec '
  mount -t proc proc "$ROOT/proc"
  mount --rbind /sys "$ROOT/sys"
  mount --rbind /dev "$ROOT/dev"
  exec chroot "$ROOT" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME='"$HOME"' LANG=C.UTF-8 \
    DEBIAN_FRONTEND=noninteractive bash -c "cd /fclib && time env \"\$@\"" try_on "$@"
' try_on "$@"
