# Installs missing packages with apt, or says how; other scripts source this file.
PATH=$PATH:/usr/sbin:/sbin

as_root() {
    if [ "$(id -u)" = 0 ]; then env "$@"; else sudo -n env "$@"; fi
}

may_install() {
    command -v apt-get >/dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }
}

# give_up WHAT COMMAND: prints what is missing and how to install it. With CI=true that is a failure.
give_up() {
    echo "== $1 is missing; install it with: $2"
    [ "${CI:-}" != true ] || exit 1
}

# require WHAT PACKAGE...: installs the packages that bring WHAT, or says how. It never removes another package.
require() {
    local what=$1
    shift
    if may_install; then
        echo "== $what is missing: installing $*"
        as_root apt-get update -qq
        as_root DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends --no-remove "$@" >/dev/null ||
            give_up "$what" "sudo apt-get install $*"
    else
        give_up "$what" "sudo apt-get install $*"
    fi
}

step() {
    echo "== $*"
    "$@"
}
