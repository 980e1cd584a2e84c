#pragma once

#include <cstdint>
#include <vector>

// The layers of SAM's decoder in double precision, written as in its paper: attention projects
// queries, keys and values. The kernels fold these projections (kernels/ops/prompt_network.h).
namespace pepeseg::reference {

// A matrix of rows.
struct Rows {
  int count = 0, size = 0;
  std::vector<double> values;  // [count, size]
  double& at(int row, int column) { return values[static_cast<size_t>(row) * size + column]; }
  double at(int row, int column) const { return values[static_cast<size_t>(row) * size + column]; }
};

// A layer y = weight x + bias, of floats so that the kernels get the same numbers.
struct Linear {
  int num_in = 0, num_out = 0;
  std::vector<float> weight, bias;  // [out, in], [out]
  Rows operator()(const Rows& x) const;
};
struct Norm {
  std::vector<float> scale, shift;
  double epsilon = 1e-5;
  Rows operator()(const Rows& x) const;
};
struct Attention {
  Linear query, key, value, out;
  int num_heads = 8;
  Rows operator()(const Rows& queries, const Rows& keys, const Rows& values) const;
};

Rows Add(const Rows& a, const Rows& b);
Rows Relu(const Rows& x);
Rows Gelu(const Rows& x);

// A transposed convolution of 2 x 2 with stride 2: weight [4, out, in], of the quarters y, x.
struct Upscaling {
  int num_in = 0, num_out = 0;
  std::vector<float> weight, bias;
  // x: [side * side, in]. Returns [4 side * side, out], a square of twice the side.
  Rows operator()(const Rows& x, int side) const;
};

// Layers with weights of random values, whose outputs are about as large as their inputs.
Linear RandomLinear(int num_in, int num_out, uint64_t seed);
Norm RandomNorm(int size, uint64_t seed);
Attention RandomAttention(int size, int inner, uint64_t seed);
Upscaling RandomUpscaling(int num_in, int num_out, uint64_t seed);
Rows RandomRows(int count, int size, uint64_t seed);

}  // namespace pepeseg::reference
