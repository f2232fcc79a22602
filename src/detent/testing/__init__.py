"""Testing host software: controllers served within a test, looked at and broken; `plugin` is the pytest fixture."""
