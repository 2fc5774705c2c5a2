"""The conformance suite: what every engine, built-in or third-party, can be held against."""
