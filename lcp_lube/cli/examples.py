"""One example a command, which its --help and man page end with; the tests run them."""

EXAMPLES: dict[str, str] = {
    "solve": "lcp-lube solve journal --set eccentricity=0.7 --accuracy 1e-2 --plot journal.png",
    "compare": "lcp-lube compare problem1 --methods din,fbn-a,active-set",
    "sweep": "lcp-lube sweep problem1 --vary U=1:10:5 --output speeds.csv",
    "explore": "lcp-lube explore journal",
    "table": "lcp-lube table 2 --quick",
    "chart": "lcp-lube chart precision problem1 --quick",
    "verify": "lcp-lube verify --quick",
    "coefficients": "lcp-lube coefficients two_groove_journal --set eccentricity=0.477",
    "sensitivity": "lcp-lube sensitivity pocketed_pad --quantity load,friction",
    "optimise": "lcp-lube optimise pocketed_pad --maximise load --vary film.pocket.depth=0.2um:5um --output best.toml",
    "doctor": "lcp-lube doctor --json",
    "new": "lcp-lube new my_pad.toml --from pocketed_pad",
    "list": "lcp-lube list",
}
