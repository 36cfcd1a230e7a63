"""Free space reasoning (Sec. 3): finds the pushing corridor and says when it no longer fits."""
