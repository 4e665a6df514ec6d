# To be sourced: work beside other work, where that leaves a core idle or waits for the network.
# `beside NAME COMMAND...` begins it. `finish NAME` waits for it, shows what it printed, and fails if it failed.
# What is still at work when the script ends is ended with it.

declare -A beside_process=() beside_output=()

beside() {
    beside_output[$1]=$(mktemp)
    # A process group of its own, which can be ended with all that it started, and which Ctrl-C does not
    # reach: a shell would otherwise have its background ignore Ctrl-C, and tests of interrupts with it.
    set -m
    "${@:2}" </dev/null >"${beside_output[$1]}" 2>&1 &
    set +m
    beside_process[$1]=$!
}

finish() {
    local status=0
    wait "${beside_process[$1]}" || status=$?
    unset "beside_process[$1]"
    printf -- '-- %s\n' "$1"
    cat "${beside_output[$1]}"
    rm "${beside_output[$1]}"
    unset "beside_output[$1]"
    ((status == 0)) || printf '%s: failed (%d)\n' "$1" "$status" >&2
    return "$status"
}

end_beside() {
    local name
    for name in "${!beside_process[@]}"; do
        kill -- "-${beside_process[$name]}" 2>/dev/null || true
    done
    rm -f "${beside_output[@]}"
}
trap end_beside EXIT
