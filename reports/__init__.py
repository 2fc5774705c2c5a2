"""reports: pages rendered from stored records; nothing here simulates."""
