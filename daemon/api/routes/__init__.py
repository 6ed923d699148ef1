"""One module a resource: parse the request, make one call, return a document."""
