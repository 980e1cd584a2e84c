#!/usr/bin/env bash
# Compares the network that deploy/detector.sh has converted with TensorFlow.js' own answer to
# photographs (tests/bench/results/words.md): prints the largest difference of its two outputs.
#   detector_check.sh PHOTOGRAPH...
# Needs npm and its registry, Python 3 with OpenCV, and a minute. Fails if scores differ by more than
# 1e-5, or sides by more than 0.01 pixels.
set -euo pipefail
(($#)) || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
deploy=$(cd "$(dirname "$0")/../../deploy" && pwd)
photos=()
for photo; do photos+=("$(readlink -f "$photo")"); done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm pack --silent --ignore-scripts @vladmandic/human@3.3.6 >/dev/null
tar -xzf ./*.tgz package/models
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts @tensorflow/tfjs@4.22.0 \
  onnxruntime-node@1.30.0
"$deploy/graph_model_to_onnx.py" package/models/centernet.json detector.onnx \
  images=tower_0/images scores=tower_0/keypoints sides=tower_0/wh
for python in python3 /usr/bin/python3; do "$python" -c 'import cv2' 2>/dev/null && break; done
"$python" - "${photos[@]}" <<'PYTHON'
import sys
import cv2
for number, path in enumerate(sys.argv[1:]):
    image = cv2.resize(cv2.cvtColor(cv2.imread(path), cv2.COLOR_BGR2RGB), (512, 512))
    image.astype("float32").tofile(f"{number}.f32")
PYTHON
cat >check.js <<'JS'
const fs = require('fs');
const tf = require('@tensorflow/tfjs');
const ort = require('onnxruntime-node');
const largest = (a, b) => a.reduce((most, value, i) => Math.max(most, Math.abs(value - b[i])), 0);
(async () => {
  await tf.setBackend('cpu');
  const json = JSON.parse(fs.readFileSync('package/models/centernet.json'));
  const bytes = fs.readFileSync('package/models/centernet.bin');
  const model = await tf.loadGraphModel(tf.io.fromMemory({
    modelTopology: json.modelTopology, weightSpecs: json.weightsManifest[0].weights,
    weightData: bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length)}));
  const session = await ort.InferenceSession.create('detector.onnx');
  for (let i = 2; i < process.argv.length; ++i) {
    const values = new Float32Array(new Uint8Array(fs.readFileSync(`${i - 2}.f32`)).buffer);
    const shape = [1, 512, 512, 3];
    const wanted = model.execute(tf.tensor4d(values, shape), ['tower_0/keypoints', 'tower_0/wh']);
    const made = await session.run({images: new ort.Tensor('float32', values, shape)});
    const scores = largest(wanted[0].dataSync(), made.scores.data);
    const sides = largest(wanted[1].dataSync(), made.sides.data);
    console.log(`${process.argv[i]}: scores differ by ${scores}, sides by ${sides} pixels`);
    if (!(scores <= 1e-5 && sides <= 0.01)) process.exitCode = 1;
  }
})();
JS
node check.js "${photos[@]}" 2>&1 | grep -v -e '^$' -e '^===' -e TensorFlow.js
exit "${PIPESTATUS[0]}"
