"""Records, requests and run states: passive types that the store, the runs and the API share."""
