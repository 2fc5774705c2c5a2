"""The conformance suite: checks for any engine, whether it is built in or from a third party."""
