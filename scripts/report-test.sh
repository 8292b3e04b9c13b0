#!/usr/bin/env bash
# Tests scripts/report.sh: what passes, fails and is left out appears in the table, the sum and the status.
set -u
cd "$(dirname "$0")/.."
. scripts/report.sh
trap 'rm -f "$log"' EXIT

step_tests() {
    check echo 'test result: ok. 12 passed; 0 failed; 0 ignored'
    check printf 'test result: ok. 3 passed; 0 failed;\n40 cases passed, 0 failed\n'
    check echo '== left out: advisories'
}

step_bad_0_1() {
    check sh -c 'echo "test result: FAILED. 5 passed; 2 failed;"; exit 101'
    check sh -c 'echo "test result: ok. 1 passed; 0 failed;"; echo a crash; exit 134'
    check sh -c 'echo no such thing; exit 3'
    check true
}

step_gpu() {
    leave_out "there is no adapter"
}

# expect TEXT IN: fails unless the text is there.
expect() {
    case $2 in *"$1"*) ;; *) echo "'$1' is not in: $2" && exit 1 ;; esac
}

good=$(run_step tests && close_report) || { echo "good steps fail: $good" && exit 1; }
expect "56 passed, 0 failed" "$good"
expect "left out: advisories" "$good"

if bad=$(run_step bad-0.1; run_step tests; CI='' run_step gpu; close_report); then echo "a failure is lost" && exit 1; fi
expect "bad-0.1" "$bad"
expect "no such thing" "$bad"
expect "status 134" "$bad"
expect "       7        4" "$bad"
expect "      56        0" "$bad"
expect "left out: there is no adapter" "$bad"
case $bad in *$'\n'"63 passed, 4 failed") ;; *) echo "the last line is wrong: $bad" && exit 1 ;; esac

if (CI=true; run_step gpu; run_step tests; close_report) >/dev/null; then echo "CI leaves a step out" && exit 1; fi
if (close_report) >/dev/null; then echo "nothing ran, and that passes" && exit 1; fi
echo "report.sh: all as it should be"
