"""What is derived from poses and depth: visibility, gt info, masks as RLE, COCO annotations."""
