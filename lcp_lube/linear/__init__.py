"""The Newton matrices and the KSP behind them."""
