#include "kernels/ops/prompt_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <list>
#include <numbers>
#include <string>

#include "kernels/network_buffer.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/prompt_reference.h"

// The ops of SAM's decoder against its layers in double precision.

namespace pepeseg {
namespace {

using reference::Attention;
using reference::Linear;
using reference::Norm;
using reference::Rows;

constexpr int kSize = kPromptChannels;

// A backend and the kind of its factors, with the error that rounding to this kind explains, as a
// share of the largest value.
struct NetworkCase : BackendCase {
  Precision precision;
  double tolerance;
};
std::unique_ptr<Backend> MakeCpu() { return MakeCpuBackend(2); }

class PromptNetworkTest : public BackendTestOf<NetworkCase> {
 protected:
  // Memory that lives as long as the test.
  DeviceSpan<float> Put(const std::vector<float>& values) {
    return floats_.emplace_back(*backend_, std::span<const float>(values)).span();
  }
  DeviceSpan<float> Put(const Rows& rows) {
    return Put(std::vector<float>(rows.values.begin(), rows.values.end()));
  }
  DeviceSpan<float> Room(int64_t size) { return floats_.emplace_back(*backend_, size).span(); }
  NetworkSpan PutFactors(const std::vector<float>& values) {
    return factors_.emplace_back(*backend_, GetParam().precision, std::span<const float>(values))
        .span();
  }
  NetworkSpan PutFactors(const Rows& rows) {
    return PutFactors(std::vector<float>(rows.values.begin(), rows.values.end()));
  }
  NetworkSpan FactorRoom(int64_t size) {
    return factors_.emplace_back(*backend_, GetParam().precision, size).span();
  }
  PromptLinear Layer(const Linear& linear) { return {PutFactors(linear.weight), Put(linear.bias)}; }
  PromptNorm Norms(const Norm& norm) { return {Put(norm.scale), Put(norm.shift)}; }
  // The weights as [in, out].
  NetworkSpan Transposed(const Linear& linear) {
    std::vector<float> columns(linear.weight.size());
    for (int out = 0; out < linear.num_out; ++out) {
      for (int in = 0; in < linear.num_in; ++in) {
        columns[static_cast<size_t>(in) * linear.num_out + out] =
            linear.weight[static_cast<size_t>(out) * linear.num_in + in];
      }
    }
    return PutFactors(columns);
  }

  std::vector<float> Get(DeviceSpan<const float> span) {
    std::vector<float> values(static_cast<size_t>(span.size));
    CopyToHost(*backend_, values.data(), span.data, values.size() * sizeof(float));
    return values;
  }
  std::vector<float> Get(const NetworkSpan& span) {
    if (span.precision == Precision::kFloat) {
      return Get(DeviceSpan<const float>{static_cast<const float*>(span.data), span.size});
    }
    std::vector<Half> halves(static_cast<size_t>(span.size));
    CopyToHost(*backend_, halves.data(), span.data, halves.size() * sizeof(Half));
    std::vector<float> values;
    for (const Half half : halves) values.push_back(FloatFromHalf(half));
    return values;
  }

  // The largest difference, as a share of the largest wanted value, is within the case's tolerance.
  void ExpectNear(const std::vector<float>& got, const std::vector<double>& want) {
    ASSERT_EQ(got.size(), want.size());
    double largest = 0, error = 0;
    for (size_t i = 0; i < got.size(); ++i) {
      largest = std::max(largest, std::abs(want[i]));
      const double here = std::abs(got[i] - want[i]);
      error = here <= error ? error : here;  // NaN counts as the largest
    }
    EXPECT_LE(error, GetParam().tolerance * largest);
  }

  std::list<Buffer<float>> floats_;
  std::list<NetworkBuffer> factors_;
};

std::string CaseName(const ::testing::TestParamInfo<NetworkCase>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(
    Kinds, PromptNetworkTest,
    ::testing::Values(NetworkCase{{"CpuFloat", MakeCpu}, Precision::kFloat, 1e-5},
                      NetworkCase{{"CpuHalf", MakeCpu}, Precision::kHalf, 3e-3},
                      NetworkCase{{"Cuda", MakeCuda}, Precision::kHalf, 3e-3}),
    CaseName);

// Concatenates the prompts' rows.
std::vector<double> Joined(const std::vector<Rows>& prompts) {
  std::vector<double> all;
  for (const Rows& rows : prompts) {
    all.insert(all.end(), rows.values.begin(), rows.values.end());
  }
  return all;
}
std::vector<float> Floats(const std::vector<double>& values) {
  return {values.begin(), values.end()};
}

TEST_P(PromptNetworkTest, EncodesPointsBySinesAndLabels) {
  const Rows frequencies = reference::RandomRows(2, kSize / 2, 1);
  const Rows labels = reference::RandomRows(5, kSize, 2);
  const Rows fixed = reference::RandomRows(kFixedTokens, kSize, 3);
  const std::vector<float> points = {10, 900, 0, 0, 1023, 3.5, 512, 77};
  const std::vector<int32_t> label = {1, -1, 0, 3};
  const Buffer<int32_t> label_buffer(*backend_, std::span<const int32_t>(label));
  constexpr int kTokens = kFixedTokens + 2;
  const DeviceSpan<float> tokens = Room(2 * kTokens * kSize);
  backend_->PromptTokens({.num_prompts = 2,
                          .num_points = 2,
                          .frame = 1024,
                          .points = Put(points),
                          .labels = label_buffer.span(),
                          .frequencies = Put(frequencies),
                          .label_tokens = Put(labels),
                          .fixed_tokens = Put(fixed),
                          .tokens = tokens});
  const std::vector<float> got = Get(tokens);
  for (int prompt = 0; prompt < 2; ++prompt) {
    for (int token = 0; token < kTokens; ++token) {
      for (int k = 0; k < kSize; ++k) {
        double want = token < kFixedTokens ? fixed.at(token, k) : 0;
        if (token >= kFixedTokens) {
          const int point = 2 * prompt + token - kFixedTokens;
          want = labels.at(label[point] + 1, k);
          const double x = 2 * (points[2 * point] + 0.5) / 1024 - 1;
          const double y = 2 * (points[2 * point + 1] + 0.5) / 1024 - 1;
          const int wave = k % (kSize / 2);
          const double angle =
              2 * std::numbers::pi * (x * frequencies.at(0, wave) + y * frequencies.at(1, wave));
          if (label[point] >= 0) want += k < kSize / 2 ? std::sin(angle) : std::cos(angle);
        }
        EXPECT_NEAR(got[(prompt * kTokens + token) * kSize + k], want, 2e-5);
      }
    }
  }
}

struct CrossCase {
  int num_prompts, num_tokens, num_places;
  bool shared;  // all prompts have the same places
};
// Attention from tokens to places is three ops: fold the queries, attend, end. That from places to
// tokens is two: fold keys and values, update.
class PromptCrossTest : public PromptNetworkTest {
 protected:
  void RunTokensToPlaces(const CrossCase& shape) {
    const Attention attention = reference::RandomAttention(kSize, kCrossChannels, 11);
    const Norm norm = reference::RandomNorm(kSize, 12);
    std::vector<Rows> tokens, encodings, places, want;
    for (int i = 0; i < shape.num_prompts; ++i) {
      tokens.push_back(reference::RandomRows(shape.num_tokens, kSize, 20 + i));
      encodings.push_back(reference::RandomRows(shape.num_tokens, kSize, 40 + i));
      if (i == 0 || !shape.shared) {
        places.push_back(reference::RandomRows(shape.num_places, kSize, 60 + i));
      }
    }
    const Rows positions = reference::RandomRows(shape.num_places, kSize, 80);
    for (int i = 0; i < shape.num_prompts; ++i) {
      const Rows& place = places[shape.shared ? 0 : i];
      want.push_back(
          norm(reference::Add(tokens[i], attention(reference::Add(tokens[i], encodings[i]),
                                                   reference::Add(place, positions), place))));
    }

    const int64_t rows = int64_t{shape.num_prompts} * TokenRows(shape.num_tokens);
    const int num_parts = PlaceParts(shape.num_places);
    const DeviceSpan<float> token_span = Put(Floats(Joined(tokens)));
    const DeviceSpan<float> encoding_span = Put(Floats(Joined(encodings)));
    const NetworkSpan folded = FactorRoom(rows * kSize);
    backend_->UpdateTokens({.num_prompts = shape.num_prompts,
                            .num_tokens = shape.num_tokens,
                            .encoding = encoding_span,
                            .tokens = token_span,
                            .query = {Layer(attention.query), Transposed(attention.key), folded}});
    const PlaceSums sums = {Room(rows * num_parts * kSize), Room(rows * num_parts),
                            Room(rows * num_parts)};
    backend_->AttendToPlaces({.num_prompts = shape.num_prompts,
                              .num_tokens = shape.num_tokens,
                              .num_places = shape.num_places,
                              .places = PutFactors(Floats(Joined(places))),
                              .positions = PutFactors(positions),
                              .rows = folded,
                              .sums = sums});
    backend_->UpdateTokens({.num_prompts = shape.num_prompts,
                            .num_tokens = shape.num_tokens,
                            .encoding = encoding_span,
                            .tokens = token_span,
                            .cross = {{sums.sums, sums.best, sums.total},
                                      num_parts,
                                      Layer(attention.value),
                                      Layer(attention.out),
                                      Norms(norm)}});
    ExpectNear(Get(token_span), Joined(want));
  }

  void RunPlacesToTokens(const CrossCase& shape) {
    const Attention attention = reference::RandomAttention(kSize, kCrossChannels, 13);
    const Norm norm = reference::RandomNorm(kSize, 14);
    std::vector<Rows> tokens, encodings, places, want;
    const Rows positions = reference::RandomRows(shape.num_places, kSize, 81);
    for (int i = 0; i < shape.num_prompts; ++i) {
      tokens.push_back(reference::RandomRows(shape.num_tokens, kSize, 20 + i));
      encodings.push_back(reference::RandomRows(shape.num_tokens, kSize, 40 + i));
      if (i == 0 || !shape.shared) {
        places.push_back(reference::RandomRows(shape.num_places, kSize, 60 + i));
      }
      const Rows& place = places.back();
      want.push_back(norm(
          reference::Add(place, attention(reference::Add(place, positions),
                                          reference::Add(tokens[i], encodings[i]), tokens[i]))));
    }
    const int64_t rows = int64_t{shape.num_prompts} * TokenRows(shape.num_tokens);
    const NetworkSpan keys = FactorRoom(rows * kSize), values = FactorRoom(rows * kSize);
    const DeviceSpan<float> bias = Room(rows);
    backend_->UpdateTokens(
        {.num_prompts = shape.num_prompts,
         .num_tokens = shape.num_tokens,
         .encoding = Put(Floats(Joined(encodings))),
         .tokens = Put(Floats(Joined(tokens))),
         .places = {Layer(attention.key), Layer(attention.value), Transposed(attention.query),
                    PutFactors(attention.out.weight), Put(attention.query.bias), keys, values,
                    bias}});
    // Places of a prompt of its own are updated in place.
    const NetworkSpan from = PutFactors(Floats(Joined(places)));
    const NetworkSpan updated =
        shape.shared ? FactorRoom(int64_t{shape.num_prompts} * shape.num_places * kSize) : from;
    backend_->UpdatePlaces({.num_prompts = shape.num_prompts,
                            .num_tokens = shape.num_tokens,
                            .num_places = shape.num_places,
                            .places = from,
                            .positions = PutFactors(positions),
                            .keys = keys,
                            .values = values,
                            .bias = bias,
                            .out_bias = Put(attention.out.bias),
                            .norm = Norms(norm),
                            .updated = updated});
    ExpectNear(Get(updated), Joined(want));
  }
};
INSTANTIATE_TEST_SUITE_P(
    Kinds, PromptCrossTest,
    ::testing::Values(NetworkCase{{"CpuFloat", MakeCpu}, Precision::kFloat, 1e-5},
                      NetworkCase{{"CpuHalf", MakeCpu}, Precision::kHalf, 3e-3},
                      NetworkCase{{"Cuda", MakeCuda}, Precision::kHalf, 3e-3}),
    CaseName);

TEST_P(PromptCrossTest, AttendsFromTokensToSharedPlaces) { RunTokensToPlaces({3, 7, 64, true}); }
TEST_P(PromptCrossTest, AttendsFromTokensToPlacesOfTheirOwn) {
  RunTokensToPlaces({2, 6, 128, false});
}
TEST_P(PromptCrossTest, AttendsFromMoreThanEightTokens) {
  RunTokensToPlaces({2, 9, 64, true});
  RunTokensToPlaces({1, 16, 64, true});
}
TEST_P(PromptCrossTest, MergesThePartsOfManyPlaces) { RunTokensToPlaces({1, 6, 4096, true}); }

TEST_P(PromptCrossTest, AttendsFromSharedPlacesToTokens) { RunPlacesToTokens({3, 7, 64, true}); }
TEST_P(PromptCrossTest, UpdatesPlacesInPlace) { RunPlacesToTokens({2, 8, 320, false}); }
TEST_P(PromptCrossTest, AttendsFromPlacesToMoreThanEightTokens) {
  RunPlacesToTokens({2, 10, 128, true});
  RunPlacesToTokens({1, 16, 64, false});
}

TEST_P(PromptNetworkTest, AttendsAmongTokensAndRunsTheMlp) {
  for (const int num_tokens : {6, 7, 16}) {
    for (const bool is_first : {false, true}) {
      const Attention attention = reference::RandomAttention(kSize, kSize, 15);
      const Norm norm = reference::RandomNorm(kSize, 16),
                 mlp_norm = reference::RandomNorm(kSize, 17);
      const Linear in = reference::RandomLinear(kSize, kMlpChannels, 18);
      const Linear out = reference::RandomLinear(kMlpChannels, kSize, 19);
      std::vector<Rows> tokens, encodings, want;
      for (int i = 0; i < 2; ++i) {
        tokens.push_back(reference::RandomRows(num_tokens, kSize, 20 + i));
        encodings.push_back(reference::RandomRows(num_tokens, kSize, 40 + i));
        // The MLP comes first: it belongs to the layer before.
        const Rows x = mlp_norm(reference::Add(tokens[i], out(reference::Relu(in(tokens[i])))));
        const Rows with = is_first ? x : reference::Add(x, encodings[i]);
        const Rows mixed = attention(with, with, x);
        want.push_back(norm(is_first ? mixed : reference::Add(x, mixed)));
      }
      const DeviceSpan<float> span = Put(Floats(Joined(tokens)));
      backend_->UpdateTokens({.num_prompts = 2,
                              .num_tokens = num_tokens,
                              .encoding = Put(Floats(Joined(encodings))),
                              .tokens = span,
                              .mlp = {Layer(in), Layer(out), Norms(mlp_norm)},
                              .self = {is_first, Layer(attention.query), Layer(attention.key),
                                       Layer(attention.value), Layer(attention.out), Norms(norm)}});
      ExpectNear(Get(span), Joined(want));
    }
  }
}

TEST_P(PromptNetworkTest, ReadsAnswersFromTheFixedTokens) {
  constexpr int kPrompts = 3, kTokens = 7;
  TokenHeadsArgs args;
  args.num_prompts = kPrompts;
  args.num_tokens = kTokens;
  const Rows tokens = reference::RandomRows(kPrompts * kTokens, kSize, 5);
  std::vector<double> want_ious, want_products;
  std::vector<Linear> layers[5];
  for (int head = 0; head < 5; ++head) {
    const int num_out = head == 0 ? kPromptMasks : kMaskChannels;
    layers[head] = {reference::RandomLinear(kSize, kSize, 100 + 10 * head),
                    reference::RandomLinear(kSize, kSize, 102 + 10 * head),
                    reference::RandomLinear(kSize, num_out, 104 + 10 * head)};
    TokenHead& to = head == 0 ? args.iou : args.mask[head - 1];
    for (int layer = 0; layer < 3; ++layer) to.layer[layer] = Layer(layers[head][layer]);
  }
  for (int prompt = 0; prompt < kPrompts; ++prompt) {
    for (int head = 0; head < 5; ++head) {
      Rows x{1, kSize, {}};
      for (int k = 0; k < kSize; ++k) x.values.push_back(tokens.at(prompt * kTokens + head, k));
      const auto& l = layers[head];
      const Rows y = l[2](reference::Relu(l[1](reference::Relu(l[0](x)))));
      auto& to = head == 0 ? want_ious : want_products;
      to.insert(to.end(), y.values.begin(), y.values.end());
    }
  }
  args.tokens = Put(tokens);
  args.ious = Room(kPrompts * kPromptMasks);
  args.products = Room(kPrompts * kPromptMasks * kMaskChannels);
  backend_->TokenHeads(args);
  ExpectNear(Get(args.ious), want_ious);
  ExpectNear(Get(args.products), want_products);
}

struct UpscaleCase {
  int num_prompts, side, width, height;

  // Returns whether a cell of the masks shows the photograph.
  bool Shows(size_t cell) const {
    const int extent = 4 * side;
    const int x = static_cast<int>(cell) % extent, y = static_cast<int>(cell) / extent % extent;
    return x < width && y < height;
  }
};

class PromptUpscaleTest : public PromptNetworkTest {
 protected:
  void Run(const UpscaleCase& shape) {
    const auto first = reference::RandomUpscaling(kSize, kUpscaledChannels, 31);
    const auto second = reference::RandomUpscaling(kUpscaledChannels, kMaskChannels, 33);
    Norm norm = reference::RandomNorm(kUpscaledChannels, 35);
    norm.epsilon = 1e-6;
    std::vector<Rows> places;
    const Rows products =
        reference::RandomRows(shape.num_prompts * kPromptMasks, kMaskChannels, 36);
    std::vector<double> want;
    for (int i = 0; i < shape.num_prompts; ++i) {
      places.push_back(reference::RandomRows(shape.side * shape.side, kSize, 50 + i));
      const Rows middle = reference::Gelu(norm(first(places[i], shape.side)));
      const Rows cells = reference::Gelu(second(middle, 2 * shape.side));
      for (int mask = 0; mask < kPromptMasks; ++mask) {
        for (int cell = 0; cell < cells.count; ++cell) {
          double sum = 0;
          for (int c = 0; c < kMaskChannels; ++c) {
            sum += cells.at(cell, c) * products.at(i * kPromptMasks + mask, c);
          }
          want.push_back(sum);
        }
      }
    }
    const auto num_cells = static_cast<int64_t>(want.size());
    const DeviceSpan<float> logits = Room(num_cells);
    Buffer<int8_t> quarters(*backend_, num_cells);
    Buffer<uint32_t> bits(*backend_, num_cells / 32);
    const int num_masks = shape.num_prompts * kPromptMasks;
    Buffer<int32_t> areas(*backend_, num_masks * 3);
    backend_->UpscaleMasks({.num_prompts = shape.num_prompts,
                            .side = shape.side,
                            .width = shape.width,
                            .height = shape.height,
                            .places = PutFactors(Floats(Joined(places))),
                            .first = PutFactors(first.weight),
                            .second = PutFactors(second.weight),
                            .first_bias = Put(first.bias),
                            .second_bias = Put(second.bias),
                            .norm = Norms(norm),
                            .products = Put(products),
                            .logits = logits,
                            .quarters = quarters.span(),
                            .bits = bits.span(),
                            .areas = areas.span()});
    const std::vector<float> got = Get(logits);
    for (size_t i = 0; i < want.size(); ++i) {
      if (!shape.Shows(i)) want[i] = got[i];  // unspecified
    }
    ExpectNear(got, want);
    ExpectMasksOf(shape, got, quarters, bits, areas);
  }

  // Bytes, bits and areas are those of the logits. CUDA rounds logits to halves for them.
  void ExpectMasksOf(const UpscaleCase& shape, const std::vector<float>& logits,
                     const Buffer<int8_t>& quarters, const Buffer<uint32_t>& bits,
                     const Buffer<int32_t>& areas) {
    std::vector<int8_t> bytes(static_cast<size_t>(quarters.size()));
    quarters.Download(bytes);
    std::vector<uint32_t> words(static_cast<size_t>(bits.size()));
    bits.Download(words);
    std::vector<int32_t> counts(static_cast<size_t>(areas.size()));
    areas.Download(counts);
    const int extent = 4 * shape.side;
    std::vector<int32_t> want(counts.size()), doubtful(counts.size());
    for (size_t i = 0; i < logits.size(); ++i) {
      const bool counted = shape.Shows(i);
      const double quarter = std::clamp(4.0 * logits[i], -127.0, 127.0);
      if (counted) {
        EXPECT_LE(std::abs(bytes[i] - quarter), 0.5 + std::abs(quarter) * 0x1p-11 + 1e-6);
      }
      EXPECT_EQ(words[i / 32] >> (i % 32) & 1, counted && logits[i] > 0) << i;
      for (int k = 0; counted && k < 3; ++k) {
        const size_t at = i / (static_cast<size_t>(extent) * extent) * 3 + k;
        want[at] += logits[i] > static_cast<float>(k - 1);
        doubtful[at] += k != 1 && std::abs(logits[i] - (k - 1)) < 1e-3;
      }
    }
    for (size_t i = 0; i < counts.size(); ++i) {
      EXPECT_LE(std::abs(counts[i] - want[i]), doubtful[i]) << i;
      EXPECT_GT(counts[i], 0);
    }
  }
};
INSTANTIATE_TEST_SUITE_P(
    Kinds, PromptUpscaleTest,
    ::testing::Values(NetworkCase{{"CpuFloat", MakeCpu}, Precision::kFloat, 1e-5},
                      NetworkCase{{"CpuHalf", MakeCpu}, Precision::kHalf, 3e-3},
                      NetworkCase{{"Cuda", MakeCuda}, Precision::kHalf, 4e-3}),
    CaseName);

TEST_P(PromptUpscaleTest, UpscalesPlacesToMasks) { Run({2, 8, 32, 32}); }
TEST_P(PromptUpscaleTest, CountsOnlyCellsOfThePhotograph) {
  Run({1, 8, 32, 21});
  Run({1, 16, 37, 64});
}
TEST_P(PromptUpscaleTest, UpscalesMoreThanABlockOfPlaces) { Run({1, 32, 128, 90}); }

}  // namespace
}  // namespace pepeseg
