"""Parts that several adapters share: trees and closures, equations of motion, steps and samples, files."""
