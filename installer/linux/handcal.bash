# Completion of handcal in bash: commands, options and their choices, as --help lists them.
_handcal() {
    local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} word help found
    local -a command=()
    for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
        [[ $word == -* ]] && break
        command+=("$word")
    done
    help=$(COLUMNS=1000 handcal "${command[@]}" --help 2>/dev/null) || return
    if [[ $current == -* ]]; then
        found=$(grep -oE -- '--[a-z0-9-]+' <<<"$help")
    elif [[ $before == -* ]]; then
        found=$(sed -nE "s/^ +$before \{([^}]*)\}.*/\1/p" <<<"$help" | tr , '\n')
    else
        found=$(sed -nE 's/^    ([a-z-]+)( .*|$)/\1/p' <<<"$help")
    fi
    mapfile -t COMPREPLY < <(compgen -W "$found" -- "$current")
}
complete -o default -F _handcal handcal
