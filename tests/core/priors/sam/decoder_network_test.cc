#include "core/priors/sam/decoder_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "core/priors/sam/onnx_graph.h"
#include "core/priors/sam/sam_networks.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kTinySide = 8;
constexpr int64_t kTinySize = int64_t{kTinySide} * kTinySide * kPromptChannels;

std::vector<float> RandomValues(int64_t size, double deviation, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(0, deviation);
  std::vector<float> values(static_cast<size_t>(size));
  for (float& value : values) value = static_cast<float>(normal(engine));
  return values;
}

// Weights of a node are the same in each run. The scales of norms are 1.
absl::StatusOr<std::vector<float>> RandomWeights(absl::string_view output, int index,
                                                 std::span<const int64_t> shape) {
  int64_t size = 1;
  for (const int64_t extent : shape) size *= extent;
  const bool is_scale = (output.find("LayerNorm") != absl::string_view::npos && index == 1) ||
                        output == "/output_upscaling/output_upscaling.1/Mul_output_0";
  if (is_scale) return std::vector<float>(static_cast<size_t>(size), 1.0F);
  uint64_t seed = static_cast<uint64_t>(index);
  for (const char letter : output) seed = seed * 131 + static_cast<unsigned char>(letter);
  return RandomValues(size, shape.size() > 1 ? 1 / std::sqrt(shape[0]) : 0.1, seed);
}

std::vector<DecoderPoint> Prompts(int count) {
  std::vector<DecoderPoint> points;
  for (int i = 0; i < count; ++i) {
    points.push_back({10.0F + 17 * i, 100.0F - 9 * i, i % 3 == 0 ? 0 : 1});
    points.push_back({0, 0, -1});
  }
  return points;
}

std::vector<float> Logits(const DecodedMasks& masks) {
  std::vector<float> logits(static_cast<size_t>(masks.logits.size()));
  masks.logits.Download(logits);
  return logits;
}

TEST(DecoderNetwork, AnswersAPromptAloneAsAmongOthers) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kTinySide, RandomWeights, *backend, Precision::kFloat));
  const NetworkBuffer embedding(*backend, Precision::kFloat,
                                std::span<const float>(RandomValues(kTinySize, 1, 5)));
  constexpr int kPrompts = 4;
  const std::vector<DecoderPoint> points = Prompts(kPrompts);
  DecodedMasks together, alone;
  EXPECT_OK(decoder->Decode(embedding.span(), points, 2, {32, 24}, true, together));
  const std::vector<float> all = Logits(together);
  const size_t size = all.size() / kPrompts;
  for (int i = kPrompts - 1; i >= 0; --i) {
    EXPECT_OK(decoder->Decode(embedding.span(), std::span(points).subspan(2 * i, 2), 2, {32, 24},
                              true, alone));
    const std::vector<float> one = Logits(alone);
    ASSERT_EQ(one.size(), size);
    EXPECT_TRUE(std::equal(one.begin(), one.end(), all.begin() + static_cast<ptrdiff_t>(i * size)));
    EXPECT_FALSE(std::all_of(one.begin(), one.end(), [&](float x) { return x == one[0]; }));
  }
}

std::vector<float> WeightOf(const std::string& output, int index, std::vector<int64_t> shape) {
  return RandomWeights(output, index, shape).value();
}

// Returns the embedding of a mask prompt, [places, 256], by the formulas of SAM's mask_downscaling.
std::vector<double> ReferenceMaskEmbedding(const std::vector<float>& mask) {
  std::vector<double> planes(mask.begin(), mask.end());
  int side = 4 * kTinySide, num_in = 1;
  for (const int layer : {0, 3}) {
    const std::string at = "/mask_downscaling/mask_downscaling.";
    const std::string conv = at + std::to_string(layer) + "/Conv_output_0",
                      norm = at + std::to_string(layer + 1);
    const int num_out = layer == 0 ? 4 : 16, half = side / 2;
    const auto weight = WeightOf(conv, 1, {num_out, num_in, 2, 2});
    const auto bias = WeightOf(conv, 2, {num_out});
    const auto scale = WeightOf(norm + "/Mul_output_0", 0, {num_out, 1, 1});
    const auto shift = WeightOf(norm + "/Add_1_output_0", 1, {num_out, 1, 1});
    std::vector<double> next(static_cast<size_t>(half) * half * num_out);
    for (int place = 0; place < half * half; ++place) {
      double* out = &next[static_cast<size_t>(place) * num_out];
      double mean = 0, variance = 0;
      for (int o = 0; o < num_out; ++o) {
        out[o] = bias[o];
        for (int k = 0; k < num_in * 4; ++k) {
          const int y = place / half * 2 + k % 4 / 2, x = place % half * 2 + k % 2;
          out[o] += weight[static_cast<size_t>(o) * num_in * 4 + k] *
                    planes[(static_cast<size_t>(y) * side + x) * num_in + k / 4];
        }
        mean += out[o] / num_out;
      }
      for (int o = 0; o < num_out; ++o) variance += (out[o] - mean) * (out[o] - mean) / num_out;
      for (int o = 0; o < num_out; ++o) {
        const double x = (out[o] - mean) / std::sqrt(variance + 1e-6) * scale[o] + shift[o];
        out[o] = x / 2 * (1 + std::erf(x / std::sqrt(2.0)));
      }
    }
    planes = next;
    side = half;
    num_in = num_out;
  }
  const std::string last = "/mask_downscaling/mask_downscaling.6/Conv_output_0";
  const auto weight = WeightOf(last, 1, {kPromptChannels, 16, 1, 1});
  const auto bias = WeightOf(last, 2, {kPromptChannels});
  std::vector<double> embedding(static_cast<size_t>(kTinySize));
  for (size_t i = 0; i < embedding.size(); ++i) {
    const size_t c = i % kPromptChannels, place = i / kPromptChannels;
    embedding[i] = bias[c];
    for (size_t k = 0; k < 16; ++k) embedding[i] += weight[c * 16 + k] * planes[place * 16 + k];
  }
  return embedding;
}

// A mask takes the place of the embedding of "no mask": an embedding that has the difference has
// the same answers without one.
TEST(DecoderNetwork, TakesAMaskInPlaceOfNone) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kTinySide, RandomWeights, *backend, Precision::kFloat));
  const std::vector<float> values = RandomValues(kTinySize, 1, 5);
  const std::vector<float> mask = RandomValues(int64_t{16} * kTinySide * kTinySide, 5, 6);
  const std::vector<double> of_mask = ReferenceMaskEmbedding(mask);
  ASSERT_OK_AND_ASSIGN(
      const std::vector<float> of_none,
      RandomWeights("/Mul_9_output_0", 1, std::vector<int64_t>{1, kPromptChannels, 1, 1}));
  std::vector<float> shifted;
  for (size_t i = 0; i < values.size(); ++i) {
    shifted.push_back(static_cast<float>(values[i] + of_mask[i] - of_none[i % kPromptChannels]));
  }
  const NetworkBuffer plain(*backend, Precision::kFloat, std::span<const float>(values));
  const NetworkBuffer with_mask(*backend, Precision::kFloat, std::span<const float>(shifted));
  const std::vector<DecoderPoint> points = {{40, 30, 1}, {20, 20, 2}, {90, 80, 3}};
  DecodedMasks got, want, without;
  EXPECT_OK(decoder->DecodeWithMask(plain.span(), points, mask, {32, 24}, got));
  EXPECT_OK(decoder->Decode(with_mask.span(), points, 3, {32, 24}, true, want));
  EXPECT_OK(decoder->Decode(plain.span(), points, 3, {32, 24}, true, without));
  const std::vector<float> logits = Logits(got), expected = Logits(want), other = Logits(without);
  ASSERT_EQ(logits.size(), expected.size());
  double largest = 0, error = 0, difference = 0;
  for (size_t i = 0; i < logits.size(); ++i) {
    largest = std::max<double>(largest, std::abs(expected[i]));
    error = std::max<double>(error, std::abs(logits[i] - expected[i]));
    difference = std::max<double>(difference, std::abs(logits[i] - other[i]));
  }
  EXPECT_LT(error, 1e-4 * largest);
  EXPECT_GT(difference, 0.1 * largest);
}

TEST(DecoderNetwork, RefusesAMaskOfAnotherSize) {
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kTinySide, RandomWeights, *backend, Precision::kFloat));
  const NetworkBuffer embedding(*backend, Precision::kFloat, kTinySize);
  const std::vector<DecoderPoint> points = {{40, 30, 1}};
  const std::vector<float> mask(16 * kTinySide * kTinySide - 1);
  DecodedMasks masks;
  const absl::Status status =
      decoder->DecodeWithMask(embedding.span(), points, mask, {32, 32}, masks);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
}

TEST(DecoderNetwork, RefusesMoreTokensThanItHolds) {
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kTinySide, RandomWeights, *backend, Precision::kFloat));
  const NetworkBuffer embedding(*backend, Precision::kFloat, kTinySize);
  const std::vector<DecoderPoint> points(12);
  DecodedMasks masks;
  const absl::Status status = decoder->Decode(embedding.span(), points, 12, {32, 32}, true, masks);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
}

TEST(DecoderNetwork, ReturnsTheErrorOfAMissingWeight) {
  const auto backend = MakeCpuBackend(1);
  const auto decoder = DecoderNetwork::Make(
      kTinySide,
      [](absl::string_view output, int index, std::span<const int64_t> shape) {
        return output == "/transformer/layers.1/mlp/lin2/MatMul_output_0"
                   ? absl::InvalidArgumentError("no such node")
                   : RandomWeights(output, index, shape);
      },
      *backend, Precision::kFloat);
  EXPECT_TRUE(absl::IsInvalidArgument(decoder.status())) << decoder.status();
}

// CUDA rounds factors to halves: a logit is a sum of thousands of products of rounded factors.
TEST(DecoderNetwork, AnswersOnCudaAsOnTheCpu) {
  const auto cuda = MakeCuda();
  if (cuda == nullptr) {
    if (HasFailure()) FAIL();
    GTEST_SKIP() << "this machine has no Cuda";
  }
  const auto cpu = MakeCpuBackend(2);
  const std::vector<float> values = RandomValues(kTinySize, 1, 5);
  const std::vector<float> mask = RandomValues(1024, 5, 6);
  const std::vector<DecoderPoint> points = Prompts(5);
  std::vector<float> logits[2], with_mask[2];
  for (const bool on_cuda : {false, true}) {
    Backend& backend = on_cuda ? *cuda : *cpu;
    const Precision precision = on_cuda ? Precision::kHalf : Precision::kFloat;
    ASSERT_OK_AND_ASSIGN(const auto decoder,
                         DecoderNetwork::Make(kTinySide, RandomWeights, backend, precision));
    const NetworkBuffer embedding(backend, precision, std::span<const float>(values));
    DecodedMasks masks;
    EXPECT_OK(decoder->Decode(embedding.span(), points, 2, {32, 32}, true, masks));
    logits[on_cuda] = Logits(masks);
    EXPECT_OK(decoder->DecodeWithMask(embedding.span(), std::span(points).first(6), mask, {32, 32},
                                      masks));
    with_mask[on_cuda] = Logits(masks);
  }
  for (const auto& pair : {logits, with_mask}) {
    double largest = 0, error_of = 0;
    for (size_t i = 0; i < pair[0].size(); ++i) {
      largest = std::max<double>(largest, std::abs(pair[0][i]));
      const double here = std::abs(pair[0][i] - pair[1][i]);
      error_of = here <= error_of ? error_of : here;
    }
    EXPECT_LT(error_of, 0.02 * largest);
  }
}

// Needs the files that deploy/sam.sh installs: `make sam-test`.
TEST(RealDecoder, AgreesWithOnnxRuntime) {
  const char* folder = std::getenv("PEPESEG_SAM");
  if (folder == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  OnnxGraphEdit edit;
  edit.inputs = {{"image_embeddings", {1, 256, 64, 64}},
                 {"point_coords", {1, -1, 2}},
                 {"point_labels", {1, -1}},
                 {"mask_input", {1, 1, 256, 256}},
                 {"has_mask_input", {1}}};
  edit.outputs = {{kSamMasks, {-1, 4, 256, 256}}, {kSamIous, {-1, 4}}};
  ASSERT_OK_AND_ASSIGN(const auto networks, SamNetworks::Open(folder, edit, {2}));
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto decoder, DecoderNetwork::Load(std::string(folder) + "/sam.onnx",
                                                                *backend, Precision::kFloat));
  // A picture of rectangles, so that masks have borders.
  Image photo{640, 480, 3, {}};
  for (int i = 0; i < 640 * 480; ++i) {
    const int x = i % 640, y = i / 640;
    const bool box = x > 120 && x < 330 && y > 90 && y<300, bar = y> 350 && x > 400;
    photo.pixels.push_back(box ? 220 : 60);
    photo.pixels.push_back(bar ? 200 : 80);
    photo.pixels.push_back(static_cast<uint8_t>(x / 4));
  }
  ASSERT_OK_AND_ASSIGN(const OnnxTensor embedding, EmbedPhotograph(*networks->encoder, photo));
  std::vector<float> places;
  for (size_t place = 0; place < 4096; ++place) {
    for (size_t c = 0; c < 256; ++c) places.push_back(embedding.values[c * 4096 + place]);
  }
  const NetworkBuffer places_buffer(*backend, Precision::kFloat, std::span<const float>(places));
  std::vector<float> mask(65536, -10.0F);
  for (int i = 0; i < 65536; ++i) {
    if (i % 256 > 48 && i % 256 < 132 && i / 256 > 36 && i / 256 < 120) mask[i] = 10;
  }
  const std::vector<DecoderPoint> one = {{360, 300, 1}, {0, 0, -1}};
  const std::vector<DecoderPoint> box = {
      {300, 260, 1}, {700, 600, 0}, {190, 140, 2}, {530, 480, 3}};
  for (const bool has_mask : {false, true}) {
    const std::vector<DecoderPoint>& prompt = has_mask ? box : one;
    std::vector<float> points, labels;
    for (const DecoderPoint& point : prompt) {
      points.insert(points.end(), {point.x, point.y});
      labels.push_back(static_cast<float>(point.label));
    }
    const auto num_points = static_cast<int64_t>(prompt.size());
    const std::array<float, 1> has = {has_mask ? 1.0F : 0.0F};
    const std::array<OnnxInput, 5> inputs = {
        OnnxInput{"image_embeddings", embedding.shape, embedding.values},
        OnnxInput{"point_coords", {1, num_points, 2}, points},
        OnnxInput{"point_labels", {1, num_points}, labels},
        OnnxInput{"mask_input", {1, 1, 256, 256}, mask}, OnnxInput{"has_mask_input", {1}, has}};
    ASSERT_OK_AND_ASSIGN(const auto want, RunSamDecoder(*networks->decoder, inputs, 1));
    DecodedMasks masks;
    EXPECT_OK(has_mask
                  ? decoder->DecodeWithMask(places_buffer.span(), prompt, mask, {256, 192}, masks)
                  : decoder->Decode(places_buffer.span(), prompt, static_cast<int>(num_points),
                                    {256, 192}, true, masks));
    const std::vector<float> got = Logits(masks);
    ASSERT_EQ(got.size(), want[0].values.size());
    for (size_t i = 0; i < got.size(); ++i) {
      if (i % 65536 >= 192 * 256) continue;  // below the extent, where nothing is computed
      ASSERT_NEAR(got[i], want[0].values[i], 1e-3) << i;
    }
    std::vector<float> ious(4);
    masks.ious.Download(ious);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(ious[i], want[1].values[i], 1e-4);
  }
}

}  // namespace
}  // namespace pepeseg
