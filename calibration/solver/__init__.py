"""The steps of the estimate: initial guess, outlying views, systematic errors, target scale, the assembled solution."""
