"""reports: pages rendered from stored records. This package runs no simulation."""
