"""In place of the package of that name, as where the tests are not installed."""

raise ImportError("measured as installed, without the packages of the tests")
