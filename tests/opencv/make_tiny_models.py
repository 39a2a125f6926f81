#!/usr/bin/env python3
"""Writes tiny ONNX networks whose weights are set by hand, one for every kind of output the detector understands.

usage: make_tiny_models.py FOLDER

The networks look for red and blue squares of 24x24 pixels in a 64x64 image: a convolution takes the mean colour of a
24x24 window around each of 8x8 cells, a sigmoid makes a score of it. Written without any library: an ONNX file is a
protocol buffer, and the few messages needed are short.
"""
import os
import struct
import sys


def varint(n):
    n &= (1 << 64) - 1
    out = b""
    while True:
        byte = n & 0x7F
        n >>= 7
        if n:
            out += bytes([byte | 0x80])
        else:
            return out + bytes([byte])


def number(field, value):
    return varint(field << 3) + varint(value)


def text(field, value):
    data = value if isinstance(value, bytes) else value.encode()
    return varint(field << 3 | 2) + varint(len(data)) + data


def tensor(name, shape, values, integer=False):
    data = struct.pack("<%d%s" % (len(values), "q" if integer else "f"), *values)
    message = b"".join(number(1, d) for d in shape) + number(2, 7 if integer else 1)
    return message + text(8, name) + text(9, data)


def attribute(name, value):
    message = text(1, name)
    if isinstance(value, int):
        return message + number(3, value) + number(20, 2)
    return message + b"".join(number(8, v) for v in value) + number(20, 7)


def node(kind, inputs, outputs, **attributes):
    message = b"".join(text(1, i) for i in inputs) + b"".join(text(2, o) for o in outputs)
    message += text(3, outputs[0]) + text(4, kind)
    return message + b"".join(text(5, attribute(k, v)) for k, v in attributes.items())


def value(name, shape):
    dims = b"".join(text(1, number(1, d)) for d in shape)
    return text(1, name) + text(2, text(1, number(1, 1) + text(2, dims)))


def write(path, nodes, tensors, outputs):
    graph = b"".join(text(1, n) for n in nodes) + text(2, "tiny") + b"".join(text(5, t) for t in tensors)
    graph += text(11, value("image", (1, 3, SIZE, SIZE))) + b"".join(text(12, value(n, s)) for n, s in outputs)
    model = number(1, 7) + text(2, "apso") + text(7, graph) + text(8, text(1, "") + number(2, 12))
    with open(path, "wb") as file:
        file.write(model)


SIZE = 64  # pixels of the image
CELL = 8  # pixels of a cell
SIDE = 24  # pixels of the window, and of the boxes
CELLS = SIZE // CELL
COUNT = CELLS * CELLS
COLOURS = ((1.0, -0.5, -0.5), (-0.5, -0.5, 1.0))  # class 0 is red, class 1 is blue; weights of R, G, B


def colour_convolution(side, gain, threshold):
    """Weights and biases: gain * (mean over side x side pixels - threshold) for each colour."""
    weights = [gain * c / (side * side) for colour in COLOURS for c in colour for _ in range(side * side)]
    return weights, [-gain * threshold] * len(COLOURS)


def scores():
    """Nodes and tensors of `scores`, 1 x 2 x COUNT."""
    weights, bias = colour_convolution(SIDE, 24.0, 0.8)
    nodes = [
        node("Conv", ["image", "window", "window_bias"], ["logits"], kernel_shape=[SIDE, SIDE], strides=[CELL, CELL],
             pads=[CELL, CELL, CELL, CELL]),
        node("Sigmoid", ["logits"], ["cells"]),
        node("Reshape", ["cells", "flat"], ["scores"]),
    ]
    tensors = [tensor("window", (2, 3, SIDE, SIDE), weights), tensor("window_bias", (2,), bias),
               tensor("flat", (3,), (1, 2, COUNT), True)]
    return nodes, tensors


def centres():
    return [(CELL * (i % CELLS) + CELL / 2, CELL * (i // CELLS) + CELL / 2) for i in range(COUNT)]


def box_channels():
    """cx, cy, w, h of all cells, channel by channel."""
    c = centres()
    return [x for x, _ in c] + [y for _, y in c] + [SIDE] * (2 * COUNT)


def first_columns(constant, columns, output):
    """Nodes that make a constant an output: beside the scores, so that it depends on the image, and cut off again."""
    return [node("Concat", [constant, "scores"], [constant + "_and_scores"], axis=1),
            node("Slice", [constant + "_and_scores", "zero", constant + "_end", "axis"], [output])]


def main(folder):
    os.makedirs(folder, exist_ok=True)
    at = lambda name: os.path.join(folder, name)

    # boxes and classes, one column per box (YOLOv8 and later)
    nodes, tensors = scores()
    boxes = tensor("boxes", (1, 4, COUNT), box_channels())
    write(at("tiny_yolov8.onnx"), nodes + [node("Concat", ["boxes", "scores"], ["output0"], axis=1)], tensors + [boxes],
          [("output0", (1, 6, COUNT))])

    # the same with masks: two prototypes, one per colour, and their coefficients
    weights, bias = colour_convolution(4, 40.0, 0.5)
    write(at("tiny_yolov8_seg.onnx"),
          nodes + [node("Concat", ["boxes", "scores", "scores"], ["output0"], axis=1),
                   node("Conv", ["image", "fine", "fine_bias"], ["output1"], kernel_shape=[4, 4], strides=[4, 4])],
          tensors + [boxes, tensor("fine", (2, 3, 4, 4), weights), tensor("fine_bias", (2,), bias)],
          [("output0", (1, 8, COUNT)), ("output1", (1, 2, SIZE // 4, SIZE // 4))])

    # one row per box, with objectness (YOLOv5, v7)
    boxes5 = tensor("boxes", (1, 5, COUNT), box_channels() + [1.0] * COUNT)
    write(at("tiny_yolov5.onnx"),
          nodes + [node("Concat", ["boxes", "scores"], ["columns"], axis=1),
                   node("Transpose", ["columns"], ["output"], perm=[0, 2, 1])], tensors + [boxes5],
          [("output", (1, COUNT, 7))])

    # boxes, labels, scores, masks (Mask R-CNN): red only, and a mask that fills the left half of its box
    red, red_bias = [w[: len(w) // 2] for w in colour_convolution(SIDE, 24.0, 0.8)]
    corners = [v for x, y in centres() for v in (x - SIDE / 2, y - SIDE / 2, x + SIDE / 2, y + SIDE / 2)]
    halves = [1.0 if i % 8 < 4 else 0.0 for _ in range(COUNT) for i in range(64)]
    write(at("tiny_mask_rcnn.onnx"),
          [
              node("Conv", ["image", "red_window", "red_bias"], ["red_logits"], kernel_shape=[SIDE, SIDE],
                   strides=[CELL, CELL], pads=[CELL, CELL, CELL, CELL]),
              node("Sigmoid", ["red_logits"], ["red"]),
              node("Reshape", ["red", "column"], ["scores"]),
              *first_columns("corners", 4, "boxes"),
              *first_columns("person", 1, "labels"),
              *first_columns("halves", 64, "flat_masks"),
              node("Reshape", ["flat_masks", "block"], ["masks"]),
          ],
          [
              tensor("red_window", (1, 3, SIDE, SIDE), red), tensor("red_bias", (1,), red_bias),
              tensor("column", (2,), (COUNT, 1), True), tensor("block", (4,), (COUNT, 1, 8, 8), True),
              tensor("zero", (1,), (0,), True), tensor("axis", (1,), (1,), True),
              tensor("corners", (COUNT, 4), corners), tensor("corners_end", (1,), (4,), True),
              tensor("person", (COUNT, 1), [1.0] * COUNT), tensor("person_end", (1,), (1,), True),
              tensor("halves", (COUNT, 64), halves), tensor("halves_end", (1,), (64,), True),
          ],
          [("boxes", (COUNT, 4)), ("labels", (COUNT, 1)), ("scores", (COUNT, 1)), ("masks", (COUNT, 1, 8, 8))])

    # something else: a class for the whole image
    write(at("tiny_classifier.onnx"),
          nodes[:1] + [node("GlobalAveragePool", ["logits"], ["mean"]), node("Flatten", ["mean"], ["classes"])],
          tensors[:2], [("classes", (1, 2))])


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
