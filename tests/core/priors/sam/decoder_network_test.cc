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
    for (size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], want[0].values[i], 1e-3) << i;
    std::vector<float> ious(4);
    masks.ious.Download(ious);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(ious[i], want[1].values[i], 1e-4);
  }
}

}  // namespace
}  // namespace pepeseg
