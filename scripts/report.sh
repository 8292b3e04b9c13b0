# Runs named steps and reports on them in a table; test.sh sources this file.
#
# A step is a function `step_NAME`, with `_` for `-` and `.`, that calls `check` for each command. After a failure the other
# commands and steps go on.

log=$(mktemp)
rows='' all_passed=0 all_failed=0

# count LOG STATUS: prints how many tests passed and failed. A command without tests counts as one.
count() {
    awk -v status="$2" '
        /^test result: / { passed += $4; failed += $6 }
        /^[0-9]+ cases passed, [0-9]+ failed$/ { passed += $1; failed += $4 }
        END {
            if (status != 0 && failed == 0) failed = 1
            if (passed + failed == 0) passed = 1
            print passed + 0, failed + 0
        }' "$1"
}

# check COMMAND...: runs a command of a step. If it fails, its output is shown, otherwise its headings.
check() {
    local status=0 start=$SECONDS counts
    echo "   $*"
    "$@" >"$log" 2>&1 </dev/null || status=$?
    counts=$(count "$log" "$status")
    passed=$((passed + ${counts% *})) failed=$((failed + ${counts#* }))
    echo "      $((SECONDS - start)) s, ${counts% *} passed, ${counts#* } failed"
    # A script that leaves a part out says so.
    note=${note:-$(sed -n 's/^== left out: /left out: /p' "$log" | head -n 1)}
    if [ "$status" != 0 ]; then
        echo "-- the command above failed with status $status; the last lines of its output:"
        tail -n 300 "$log"
        echo "--"
    else
        sed -n 's/^== /      /p' "$log"
    fi
    return "$status"
}

# leave_out WHY: says why a part of a step cannot run. With CI=true that is a failure.
leave_out() {
    echo "   left out: $1"
    note="left out: $1"
    if [ "${CI:-}" = true ]; then failed=$((failed + 1)); fi
}

# run_step NAME: runs a step and adds its row to the table.
run_step() {
    local start=$SECONDS row
    passed=0 failed=0 note=''
    echo "== $1"
    "step_$(echo "$1" | tr '.-' '__')"
    row=$(printf '%-12s %6s s %8s %8s   %s' "$1" $((SECONDS - start)) "$passed" "$failed" "$note")
    rows="$rows$row"$'\n'
    all_passed=$((all_passed + passed)) all_failed=$((all_failed + failed))
}

# close_report: prints the table and the sum. Returns 1 if something failed, or if nothing ran.
close_report() {
    printf '\n%-12s %8s %8s %8s\n%s' step time passed failed "$rows"
    printf '%-12s %6s s %8s %8s\n\n' all "$SECONDS" "$all_passed" "$all_failed"
    echo "$all_passed passed, $all_failed failed"
    [ "$all_failed" = 0 ] && [ "$all_passed" != 0 ]
}
