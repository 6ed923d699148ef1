"""The routes, one module per resource: parse the request, make one call, return a document."""
