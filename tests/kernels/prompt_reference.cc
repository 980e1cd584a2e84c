#include "tests/kernels/prompt_reference.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace pepeseg::reference {
namespace {

std::vector<float> RandomFloats(size_t count, double deviation, double mean, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(mean, deviation);
  std::vector<float> values(count);
  for (float& value : values) value = static_cast<float>(normal(engine));
  return values;
}

}  // namespace

Rows Linear::operator()(const Rows& x) const {
  Rows y{x.count, num_out, std::vector<double>(static_cast<size_t>(x.count) * num_out)};
  for (int row = 0; row < x.count; ++row) {
    for (int out = 0; out < num_out; ++out) {
      double sum = bias[out];
      for (int in = 0; in < num_in; ++in) {
        sum += x.at(row, in) * weight[static_cast<size_t>(out) * num_in + in];
      }
      y.at(row, out) = sum;
    }
  }
  return y;
}

Rows Norm::operator()(const Rows& x) const {
  Rows y = x;
  for (int row = 0; row < x.count; ++row) {
    double mean = 0, variance = 0;
    for (int i = 0; i < x.size; ++i) mean += x.at(row, i) / x.size;
    for (int i = 0; i < x.size; ++i) variance += std::pow(x.at(row, i) - mean, 2) / x.size;
    for (int i = 0; i < x.size; ++i) {
      y.at(row, i) = (x.at(row, i) - mean) / std::sqrt(variance + epsilon) * scale[i] + shift[i];
    }
  }
  return y;
}

Rows Attention::operator()(const Rows& queries, const Rows& keys, const Rows& values) const {
  const Rows q = query(queries), k = key(keys), v = value(values);
  const int head_size = q.size / num_heads;
  Rows mixed{q.count, q.size, std::vector<double>(q.values.size())};
  for (int head = 0; head < num_heads; ++head) {
    const int first = head * head_size;
    for (int row = 0; row < q.count; ++row) {
      std::vector<double> weights;
      double best = -1e300, total = 0;
      for (int other = 0; other < k.count; ++other) {
        double score = 0;
        for (int c = first; c < first + head_size; ++c) score += q.at(row, c) * k.at(other, c);
        weights.push_back(score / std::sqrt(head_size));
        best = std::max(best, weights.back());
      }
      for (double& weight : weights) total += weight = std::exp(weight - best);
      for (int other = 0; other < k.count; ++other) {
        for (int c = first; c < first + head_size; ++c) {
          mixed.at(row, c) += weights[other] / total * v.at(other, c);
        }
      }
    }
  }
  return out(mixed);
}

Rows Add(const Rows& a, const Rows& b) {
  Rows sum = a;
  for (size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += b.values[i];
  return sum;
}

Rows Relu(const Rows& x) {
  Rows y = x;
  for (double& value : y.values) value = std::max(value, 0.0);
  return y;
}

Rows Gelu(const Rows& x) {
  Rows y = x;
  for (double& value : y.values) value *= 0.5 * (1 + std::erf(value / std::sqrt(2.0)));
  return y;
}

Rows Upscaling::operator()(const Rows& x, int side) const {
  Rows y{4 * x.count, num_out, std::vector<double>(static_cast<size_t>(4) * x.count * num_out)};
  for (int row = 0; row < x.count; ++row) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      const int top = 2 * (row / side) + quarter / 2, left = 2 * (row % side) + quarter % 2;
      for (int out = 0; out < num_out; ++out) {
        double sum = bias[out];
        const float* w = &weight[(static_cast<size_t>(quarter) * num_out + out) * num_in];
        for (int in = 0; in < num_in; ++in) sum += x.at(row, in) * w[in];
        y.at(top * 2 * side + left, out) = sum;
      }
    }
  }
  return y;
}

Linear RandomLinear(int num_in, int num_out, uint64_t seed) {
  return {num_in, num_out,
          RandomFloats(static_cast<size_t>(num_in) * num_out, 1 / std::sqrt(num_in), 0, seed),
          RandomFloats(num_out, 0.1, 0, seed + 1)};
}

Norm RandomNorm(int size, uint64_t seed) {
  return {RandomFloats(size, 0.1, 1, seed), RandomFloats(size, 0.1, 0, seed + 1)};
}

// Queries are larger, so that a softmax prefers some of its rows.
Attention RandomAttention(int size, int inner, uint64_t seed) {
  Attention attention = {RandomLinear(size, inner, seed), RandomLinear(size, inner, seed + 2),
                         RandomLinear(size, inner, seed + 4), RandomLinear(inner, size, seed + 6)};
  for (float& weight : attention.query.weight) weight *= 2;
  return attention;
}

Upscaling RandomUpscaling(int num_in, int num_out, uint64_t seed) {
  return {num_in, num_out,
          RandomFloats(static_cast<size_t>(4) * num_in * num_out, 1 / std::sqrt(num_in), 0, seed),
          RandomFloats(num_out, 0.1, 0, seed + 1)};
}

Rows RandomRows(int count, int size, uint64_t seed) {
  const auto floats = RandomFloats(static_cast<size_t>(count) * size, 1, 0, seed);
  return {count, size, {floats.begin(), floats.end()}};
}

}  // namespace pepeseg::reference
