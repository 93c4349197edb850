"""What an operator looks at: console, page, the alarms behind them."""
