"""Tests of mbref, crosscheck and reports; a package, because wheels such as dartpy bring one called tests."""
