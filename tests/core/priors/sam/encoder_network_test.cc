#include "core/priors/sam/encoder_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>

#include "core/dataset/import.h"
#include "core/priors/sam/onnx_weights.h"
#include "core/priors/sam/sam_networks.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/relative_rms.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

// A small encoder: every layer of the large one, with windows that need padding.
EncoderShape TinyShape() {
  EncoderShape shape;
  shape.frame = 128;
  shape.channels = {16, 16, 24, 32};
  shape.blocks = {1, 2, 1, 1};
  shape.heads = {0, 1, 2, 1};
  shape.embedding = 32;
  return shape;
}

// Random weights, the same for the same name, of a size that keeps activations near 1.
absl::StatusOr<std::vector<float>> RandomWeights(absl::string_view output, int index,
                                                 std::span<const int64_t> shape) {
  int64_t count = 1;
  for (const int64_t size : shape) count *= size;
  // Convolutions are [out, in, down, across], matrices [in, out].
  int64_t terms = 1;
  if (shape.size() == 4) terms = count / shape[0];
  if (shape.size() == 2) terms = shape[0];
  uint64_t seed = static_cast<uint64_t>(index);
  for (const char letter : output) seed = seed * 131 + static_cast<uint8_t>(letter);
  std::mt19937_64 engine(seed);
  std::vector<float> values(count);
  for (float& value : values) {
    const double unit = static_cast<double>(engine() >> 11) * 0x1p-52 - 1;
    value = static_cast<float>(1.7 * unit / std::sqrt(static_cast<double>(terms)));
  }
  return values;
}

Image RandomPhoto(int width, int height, uint64_t seed) {
  std::mt19937_64 engine(seed);
  Image photo = {width, height, 3, {}};
  for (int i = 0; i < width * height * 3; ++i) {
    photo.pixels.push_back(static_cast<uint8_t>(engine()));
  }
  return photo;
}

std::vector<float> Embed(EncoderNetwork& network, const std::vector<const Image*>& photos) {
  NetworkBuffer embeddings;
  EXPECT_OK(network.Encode(photos, &embeddings));
  return embeddings.Download();
}

TEST(EncoderNetwork, ReadsEachWeightOnce) {
  const auto backend = MakeCpuBackend(1);
  std::set<std::string> read;
  const auto source = [&](absl::string_view output, int index, std::span<const int64_t> shape) {
    EXPECT_TRUE(read.insert(std::string(output) + std::to_string(index)).second) << output;
    return RandomWeights(output, index, shape);
  };
  ASSERT_OK(EncoderNetwork::Make(EncoderShape(), source, *backend, Precision::kFloat));
  // 2 + 15 convolutions with bias in stage 0 and the downsampling, 13 tensors in each of 10 blocks
  // of attention with two of a depthwise convolution, 6 in the neck.
  EXPECT_EQ(read.size(), 2 * 2 + 15 * 2 + 10 * 15 + 6);
}

TEST(EncoderNetwork, ReturnsTheErrorOfAWeight) {
  const auto backend = MakeCpuBackend(1);
  const auto source = [&](absl::string_view output, int index,
                          std::span<const int64_t> shape) -> absl::StatusOr<std::vector<float>> {
    if (output == "output") return absl::InvalidArgumentError("lost");
    return RandomWeights(output, index, shape);
  };
  EXPECT_STATUS(EncoderNetwork::Make(TinyShape(), source, *backend, Precision::kFloat),
                absl::StatusCode::kInvalidArgument, "lost");
}

TEST(EncoderNetwork, NamesAFileThatIsNotTheModel) {
  const testing::TempFolder folder;
  const std::filesystem::path file = folder / "encoder.onnx";
  std::ofstream(file) << "a text";
  const auto backend = MakeCpuBackend(1);
  const absl::Status status = EncoderNetwork::Load(file, *backend, Precision::kFloat).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(file.string() + ": not an ONNX model"));
}

class TinyEncoderTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, TinyEncoderTest, AllBackends(), BackendName);

// Photographs of other sizes, more of them than run together.
TEST_P(TinyEncoderTest, EmbedsAPhotographTheSameAloneAndAmongOthers) {
  ASSERT_OK_AND_ASSIGN(const auto network, EncoderNetwork::Make(TinyShape(), RandomWeights,
                                                                *backend_, Precision::kFloat));
  std::vector<Image> photos;
  for (int k = 0; k < 9; ++k) photos.push_back(RandomPhoto(100 + 30 * k, 200 - 20 * k, k));
  std::vector<const Image*> all;
  for (const Image& photo : photos) all.push_back(&photo);
  const std::vector<float> together = Embed(*network, all);
  const int64_t size = network->shape().embedding_size();
  ASSERT_EQ(together.size(), 9 * size);
  for (int k = 0; k < 9; ++k) {
    const std::vector<float> alone = Embed(*network, {all[k]});
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), together.begin() + k * size)) << k;
  }
}

class CudaTinyEncoderTest : public CudaAndCpuTest {};

TEST_F(CudaTinyEncoderTest, MatchesTheCpu) {
  const Image photo = RandomPhoto(300, 200, 1);
  ASSERT_OK_AND_ASSIGN(const auto on_cpu,
                       EncoderNetwork::Make(TinyShape(), RandomWeights, *cpu_, Precision::kFloat));
  const std::vector<float> want = Embed(*on_cpu, {&photo});
  for (const auto& [precision, limit] :
       {std::pair(Precision::kFloat, 1e-5), {Precision::kHalf, 2e-3}}) {
    ASSERT_OK_AND_ASSIGN(const auto on_cuda,
                         EncoderNetwork::Make(TinyShape(), RandomWeights, *cuda_, precision));
    EXPECT_LT(testing::RelativeRms(Embed(*on_cuda, {&photo}), want), limit);
  }
}

// Networks must see the same input with ONNX Runtime, whose input OpenCV scales.
TEST(PrepareFrame, ScalesAsOpenCvDoes) {
  const auto backend = MakeCpuBackend(0);
  constexpr int kExtent = 256;
  for (const auto& [width, height] :
       {std::pair(512, 384), {700, 500}, {768, 256}, {100, 77}, {256, 200}, {1500, 1}, {1, 300}}) {
    SCOPED_TRACE(::testing::Message() << width << " x " << height);
    const Image photo = RandomPhoto(width, height, 3);
    const double scale = double{kExtent} / std::max(width, height);
    const cv::Mat from(height, width, CV_8UC3, const_cast<uint8_t*>(photo.pixels.data()));
    cv::Mat to;
    const cv::Size size(std::max(1, cvRound(width * scale)), std::max(1, cvRound(height * scale)));
    cv::resize(from, to, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    const Buffer<uint8_t> pixels(*backend, std::span<const uint8_t>(photo.pixels));
    NetworkBuffer frame(*backend, Precision::kFloat, kExtent * kExtent * kFrameChannels);
    backend->PrepareFrame({pixels.span(), height, width, kExtent, frame.span()});
    const std::vector<float> got = frame.Download();
    constexpr float kMean[] = {123.675f, 116.28f, 103.53f}, kScale[] = {58.395f, 57.12f, 57.375f};
    int num_different = 0;
    for (int y = 0; y < to.rows; ++y) {
      for (int x = 0; x < to.cols; ++x) {
        for (int c = 0; c < 3; ++c) {
          const float value = got[(y * kExtent + x) * kFrameChannels + c] * kScale[c] + kMean[c];
          const int difference = std::abs(cvRound(value) - to.at<cv::Vec3b>(y, x)[c]);
          ASSERT_LE(difference, 1);
          num_different += difference;
        }
      }
    }
    // Sums in another order may round one value in ten thousand to the other side.
    EXPECT_LE(num_different, to.rows * to.cols * 3 / 10000);
  }
}

TEST(RealSamEncoder, MatchesOnnxRuntime) {
  const char* folder = std::getenv("PEPESEG_SAM");
  if (folder == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const auto capture, ImportCapture(files, {}));
  const Image& photo = capture.views[0].photo;
  const std::filesystem::path sam = folder;
  ASSERT_OK_AND_ASSIGN(const auto runtime, OnnxRuntime::Load(sam / "libonnxruntime.so.1"));
  std::ifstream file(sam / "encoder.onnx", std::ios::binary);
  const std::string model{std::istreambuf_iterator<char>(file), {}};
  ASSERT_OK_AND_ASSIGN(const auto session,
                       OnnxSession::Create(*runtime, model, "encoder.onnx", {.num_threads = 2}));
  ASSERT_OK_AND_ASSIGN(const OnnxTensor planes, EmbedPhotograph(*session, photo));
  std::vector<float> want(planes.values.size());
  for (size_t i = 0; i < want.size(); ++i) want[i] = planes.values[i % 256 * 4096 + i / 256];
  const auto cpu = MakeCpuBackend(0);
  ASSERT_OK_AND_ASSIGN(const auto network,
                       EncoderNetwork::Load(sam / "encoder.onnx", *cpu, Precision::kFloat));
  EXPECT_LT(testing::RelativeRms(Embed(*network, {&photo}), want), 1e-5);
  const auto cuda = MakeCuda();
  if (cuda == nullptr) return;
  ASSERT_OK_AND_ASSIGN(const auto on_cuda,
                       EncoderNetwork::Load(sam / "encoder.onnx", *cuda, Precision::kHalf));
  EXPECT_LT(testing::RelativeRms(Embed(*on_cuda, {&photo}), want), 3e-3);
}

}  // namespace
}  // namespace pepeseg
