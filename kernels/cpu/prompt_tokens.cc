#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/factors.h"
#include "kernels/ops/prompt_network.h"

// The tokens' side of SAM's decoder: PromptTokens, UpdateTokens and TokenHeads
// (kernels/ops/prompt_network.h). A task is one prompt, or a few.

namespace pepeseg {
namespace {

constexpr int kSize = kPromptChannels;
constexpr float kEpsilon = 1e-5f;
using Rows = std::vector<float>;  // [tokens, channels]

// A PromptLinear whose weights are floats.
class Layer {
 public:
  explicit Layer(const PromptLinear& linear) : weight_(linear.weight), bias_(linear.bias) {}

  // Returns the layer's outputs for each row of x, at most kNetworkRows.
  Rows operator()(const SimdKernels& simd, const Rows& x, int num_rows) const {
    const int num_out = static_cast<int>(bias_.size);
    const int num_in = static_cast<int>(x.size()) / num_rows;
    Rows y(static_cast<size_t>(num_rows) * num_out);
    // The weights are the rows of the product and the tokens its columns, so that the weights need
    // no transposition.
    Rows columns(static_cast<size_t>(num_in) * kNetworkRows), products(kNetworkRows * kNetworkRows);
    for (int row = 0; row < num_rows; ++row) {
      for (int in = 0; in < num_in; ++in) {
        columns[static_cast<size_t>(in) * kNetworkRows + row] =
            x[static_cast<size_t>(row) * num_in + in];
      }
    }
    for (int first = 0; first < num_out; first += kNetworkRows) {
      simd.multiply_rows({num_in, kNetworkRows, weight_.data() + int64_t{first} * num_in,
                          columns.data(), products.data()});
      for (int row = 0; row < num_rows; ++row) {
        for (int out = 0; out < kNetworkRows; ++out) {
          y[static_cast<size_t>(row) * num_out + first + out] =
              bias_[first + out] + products[out * kNetworkRows + row];
        }
      }
    }
    return y;
  }
  // The same for few rows, and for any number of outputs.
  Rows ByDots(const Rows& x, int num_rows) const {
    const int num_out = static_cast<int>(bias_.size);
    const int num_in = static_cast<int>(x.size()) / num_rows;
    Rows y(static_cast<size_t>(num_rows) * num_out);
    for (int row = 0; row < num_rows; ++row) {
      for (int out = 0; out < num_out; ++out) {
        y[static_cast<size_t>(row) * num_out + out] =
            bias_[out] + Dot(&x[static_cast<size_t>(row) * num_in],
                             weight_.data() + static_cast<int64_t>(out) * num_in, num_in);
      }
    }
    return y;
  }
  const float* weight() const { return weight_.data(); }
  const float* bias() const { return bias_.data; }

 private:
  Factors weight_;
  DeviceSpan<const float> bias_;
};

// x = norm(x + y), row by row.
void AddAndNormalize(const PromptNorm& norm, const Rows& y, Rows& x) {
  for (size_t i = 0; i < x.size(); ++i) x[i] += y[i];
  for (size_t i = 0; i < x.size(); i += kSize) Normalize(norm, kSize, kEpsilon, &x[i]);
}

Rows Sum(const Rows& a, const Rows& b) {
  Rows sum = a;
  for (size_t i = 0; i < b.size(); ++i) sum[i] += b[i];
  return sum;
}

// UpdateTokens for some prompts, whose tokens the layers take together, with weights that all
// prompts share.
class TokenUpdate {
 public:
  TokenUpdate(const SimdKernels& simd, const UpdateTokensArgs& args)
      : simd_(simd),
        args_(args),
        num_tokens_(args.num_tokens),
        slots_(TokenSlots(args.num_tokens)),
        cross_value_(args.cross.value),
        cross_out_(args.cross.out),
        mlp_in_(args.mlp.in),
        mlp_out_(args.mlp.out),
        places_key_(args.places.key),
        places_value_(args.places.value),
        places_query_(args.places.query),
        places_out_(args.places.out),
        self_query_(args.self.query),
        self_key_(args.self.key),
        self_value_(args.self.value),
        self_out_(args.self.out),
        query_(args.query.query),
        query_key_(args.query.key) {}

  // Returns how many prompts Run takes at once.
  int num_at_once() const { return kNetworkRows / num_tokens_; }

  // Updates the tokens of `count` prompts from `prompt` on.
  void Run(int64_t prompt, int count) const {
    const int64_t first = prompt * num_tokens_ * kSize, size = int64_t{count} * num_tokens_ * kSize;
    float* const begin = args_.tokens.data + first;
    Rows tokens(begin, begin + size);
    const float* const encoding_begin = args_.encoding.data + first;
    const Rows encoding(encoding_begin, encoding_begin + size);
    if (!args_.cross.value.weight.empty()) EndCross(prompt, tokens);
    if (!args_.mlp.in.weight.empty()) {
      Rows hidden = Apply(mlp_in_, tokens);
      for (float& x : hidden) x = std::max(x, 0.0f);
      AddAndNormalize(args_.mlp.norm, Apply(mlp_out_, hidden, kMlpChannels), tokens);
    }
    if (!args_.places.key.weight.empty()) FoldPlaces(prompt, encoding, tokens);
    if (!args_.self.query.weight.empty()) AttendToTokens(encoding, tokens);
    if (!args_.query.query.weight.empty()) FoldQueries(prompt, encoding, tokens);
    std::copy(tokens.begin(), tokens.end(), begin);
  }

 private:
  Rows Apply(const Layer& layer, const Rows& x, int num_in = kSize) const {
    return layer(simd_, x, static_cast<int>(x.size()) / num_in);
  }

  // Returns the mean place of a row: the parts' sums on a common scale, divided by their weights.
  std::vector<float> MeanPlace(int64_t prompt, int row) const {
    const int num_parts = args_.cross.num_parts, num_rows = kPromptHeads * slots_;
    const auto at = [&](int part) { return (prompt * num_parts + part) * num_rows + row; };
    const PlaceSumsOf<const float>& sums = args_.cross.sums;
    float best = sums.best[at(0)], total = 0;
    for (int part = 1; part < num_parts; ++part) best = std::max(best, sums.best[at(part)]);
    std::vector<float> mean(kSize);
    for (int part = 0; part < num_parts; ++part) {
      const float scale = std::exp(sums.best[at(part)] - best);
      total += scale * sums.total[at(part)];
      for (int c = 0; c < kSize; ++c) mean[c] += scale * sums.sums[at(part) * kSize + c];
    }
    for (float& x : mean) x /= total;
    return mean;
  }

  void EndCross(int64_t prompt, Rows& tokens) const {
    Rows values(tokens.size() / kSize * kCrossChannels);
    for (size_t row = 0; row < tokens.size() / kSize; ++row) {
      const auto token = static_cast<int>(row % num_tokens_);
      for (int head = 0; head < kPromptHeads; ++head) {
        const std::vector<float> mean =
            MeanPlace(prompt + static_cast<int64_t>(row) / num_tokens_, head * slots_ + token);
        for (int k = 0; k < kCrossSize; ++k) {
          const int out = head * kCrossSize + k;
          values[row * kCrossChannels + out] =
              cross_value_.bias()[out] +
              Dot(mean.data(), cross_value_.weight() + static_cast<int64_t>(out) * kSize, kSize);
        }
      }
    }
    AddAndNormalize(args_.cross.norm, Apply(cross_out_, values, kCrossChannels), tokens);
  }

  // Writes, for each prompt from `prompt` on, scale * matrix, [256, 128], times the head's part of
  // each token of x, [prompts, tokens, 128].
  void Fold(int64_t prompt, const float* matrix, const Rows& x, float scale,
            const NetworkSpan& out) const {
    const int num_rows = kPromptHeads * slots_;
    const int64_t tokens_size = int64_t{num_tokens_} * kCrossChannels;
    for (int64_t first = 0; first < static_cast<int64_t>(x.size());
         first += tokens_size, ++prompt) {
      for (int row = 0; row < num_rows; ++row) {
        const int head = row / slots_, token = row % slots_;
        for (int c = 0; c < kSize; ++c) {
          float value = 0;
          if (token < num_tokens_) {
            value = scale * Dot(matrix + c * kCrossChannels + head * kCrossSize,
                                &x[first + token * kCrossChannels + head * kCrossSize], kCrossSize);
          }
          Store(out, (prompt * num_rows + row) * kSize + c, value);
        }
      }
    }
  }

  void FoldPlaces(int64_t prompt, const Rows& encoding, const Rows& tokens) const {
    constexpr float kScale = 0.25f;  // 1 / sqrt(kCrossSize)
    const Rows keys = Apply(places_key_, Sum(tokens, encoding));
    Fold(prompt, places_query_.data(), keys, kScale, args_.places.keys);
    Fold(prompt, places_out_.data(), Apply(places_value_, tokens), 1, args_.places.values);
    const int num_rows = kPromptHeads * slots_;
    const int64_t tokens_size = int64_t{num_tokens_} * kCrossChannels;
    for (int64_t first = 0; first < static_cast<int64_t>(keys.size());
         first += tokens_size, ++prompt) {
      for (int row = 0; row < num_rows; ++row) {
        const int head = row / slots_, token = row % slots_;
        float bias = -std::numeric_limits<float>::infinity();
        if (token < num_tokens_) {
          bias =
              kScale * Dot(args_.places.query_bias.data + head * kCrossSize,
                           &keys[first + token * kCrossChannels + head * kCrossSize], kCrossSize);
        }
        args_.places.bias[prompt * num_rows + row] = bias;
      }
    }
  }

  void AttendToTokens(const Rows& encoding, Rows& tokens) const {
    const bool is_first = args_.self.is_first;
    const Rows with = is_first ? tokens : Sum(tokens, encoding);
    const Rows query = Apply(self_query_, with), key = Apply(self_key_, with);
    const Rows value = Apply(self_value_, tokens);
    Rows mixed(tokens.size());
    for (size_t first = 0; first < tokens.size(); first += size_t{kSize} * num_tokens_) {
      Mix(&query[first], &key[first], &value[first], &mixed[first]);
    }
    if (is_first) std::fill(tokens.begin(), tokens.end(), 0.0f);
    AddAndNormalize(args_.self.norm, Apply(self_out_, mixed), tokens);
  }

  // Adds to `mixed`, [tokens, 256], what the attention among one prompt's tokens mixes.
  void Mix(const float* query, const float* key, const float* value, float* mixed) const {
    const float scale = 1 / std::sqrt(static_cast<float>(kSelfSize));
    for (int head = 0; head < kPromptHeads; ++head) {
      for (int token = 0; token < num_tokens_; ++token) {
        const int first = token * kSize + head * kSelfSize;
        float score[kMaxTokens], best = -std::numeric_limits<float>::infinity(), total = 0;
        for (int other = 0; other < num_tokens_; ++other) {
          score[other] =
              scale * Dot(query + first, key + other * kSize + head * kSelfSize, kSelfSize);
          best = std::max(best, score[other]);
        }
        for (int other = 0; other < num_tokens_; ++other) {
          const float weight = std::exp(score[other] - best);
          total += weight;
          for (int c = 0; c < kSelfSize; ++c) {
            mixed[first + c] += weight * value[other * kSize + head * kSelfSize + c];
          }
        }
        for (int c = 0; c < kSelfSize; ++c) mixed[first + c] /= total;
      }
    }
  }

  void FoldQueries(int64_t prompt, const Rows& encoding, const Rows& tokens) const {
    Fold(prompt, query_key_.data(), Apply(query_, Sum(tokens, encoding)), 0.25f, args_.query.rows);
  }

  const SimdKernels& simd_;
  const UpdateTokensArgs& args_;
  const int num_tokens_, slots_;
  const Layer cross_value_, cross_out_, mlp_in_, mlp_out_, places_key_, places_value_;
  const Factors places_query_, places_out_;
  const Layer self_query_, self_key_, self_value_, self_out_, query_;
  const Factors query_key_;
};

}  // namespace

void CpuBackend::PromptTokens(const PromptTokensArgs& args) {
  if (failed()) return;
  constexpr int kHalf = kSize / 2;
  const int num_tokens = kFixedTokens + args.num_points;
  pool_.ParallelFor(args.num_prompts, [&](int64_t prompt, int) {
    float* token = args.tokens.data + prompt * num_tokens * kSize;
    std::copy_n(args.fixed_tokens.data, kFixedTokens * kSize, token);
    token += kFixedTokens * kSize;
    for (int i = 0; i < args.num_points; ++i, token += kSize) {
      const int64_t point = prompt * args.num_points + i;
      const int label = args.labels[point];
      std::copy_n(args.label_tokens.data + (label + 1) * kSize, kSize, token);
      if (label < 0) continue;
      const auto place = [&](float at) { return 2 * ((at + 0.5f) / args.frame) - 1; };
      const float x = place(args.points[2 * point]), y = place(args.points[2 * point + 1]);
      for (int k = 0; k < kHalf; ++k) {
        const float angle = 2 * std::numbers::pi_v<float> *
                            (x * args.frequencies[k] + y * args.frequencies[kHalf + k]);
        token[k] += std::sin(angle);
        token[kHalf + k] += std::cos(angle);
      }
    }
  });
}

void CpuBackend::UpdateTokens(const UpdateTokensArgs& args) {
  if (failed()) return;
  const TokenUpdate update(simd_, args);
  const int64_t num_prompts = args.num_prompts, at_once = update.num_at_once();
  pool_.ParallelFor((num_prompts + at_once - 1) / at_once, [&](int64_t task, int) {
    const int64_t first = task * at_once;
    update.Run(first, static_cast<int>(std::min(at_once, num_prompts - first)));
  });
}

void CpuBackend::TokenHeads(const TokenHeadsArgs& args) {
  if (failed()) return;
  // Runs a head for one token of each prompt. The outputs of two prompts are `stride` apart.
  const auto run = [&](const TokenHead& head, int token, float* out, int64_t stride) {
    const Layer layers[] = {Layer(head.layer[0]), Layer(head.layer[1]), Layer(head.layer[2])};
    for (int prompt = 0; prompt < args.num_prompts; ++prompt) {
      const float* from = args.tokens.data + (int64_t{prompt} * args.num_tokens + token) * kSize;
      Rows x(from, from + kSize);
      for (int layer = 0; layer < 3; ++layer) {
        x = layers[layer].ByDots(x, 1);
        for (float& value : x) value = layer < 2 ? std::max(value, 0.0f) : value;
      }
      std::copy(x.begin(), x.end(), out + prompt * stride);
    }
  };
  pool_.ParallelFor(1 + kPromptMasks, [&](int64_t head, int) {
    if (head == 0) return run(args.iou, 0, args.ious.data, kPromptMasks);
    const auto mask = static_cast<int>(head) - 1;
    run(args.mask[mask], 1 + mask, args.products.data + mask * kMaskChannels,
        kPromptMasks * kMaskChannels);
  });
}

}  // namespace pepeseg
