#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/priors/sam/backend_proposals.h"
#include "tests/testing/status_testing.h"

// Masks chosen on a backend against those chosen on the host from the same decoder's logits.
namespace pepeseg {
namespace {

constexpr int kProposalSide = 8, kProposalExtent = 4 * kProposalSide, kProposalHeight = 24;

// A decoder with random weights, the same in each run. Its IoUs are near 0.8.
absl::StatusOr<std::vector<float>> WeightsOf(absl::string_view output, int index,
                                             std::span<const int64_t> shape) {
  int64_t size = 1;
  for (const int64_t extent : shape) size *= extent;
  uint64_t seed = static_cast<uint64_t>(index) + 7;
  for (const char letter : output) seed = seed * 131 + static_cast<unsigned char>(letter);
  std::mt19937_64 engine(seed);
  const bool is_scale = (output.find("LayerNorm") != absl::string_view::npos && index == 1) ||
                        output == "/output_upscaling/output_upscaling.1/Mul_output_0";
  const bool is_iou = output == "/iou_prediction_head/layers.2/Gemm_output_0" && index == 2;
  const double deviation = shape.size() > 1 ? 1.5 / std::sqrt(shape[0]) : 0.1;
  std::normal_distribution<double> normal(is_scale ? 1 : is_iou ? 0.8 : 0, deviation);
  std::vector<float> values(static_cast<size_t>(size));
  for (float& value : values) value = static_cast<float>(normal(engine));
  return values;
}

// Segments by a decoder's logits, copied to the host.
class LogitSegmenter : public PromptedSegmenter {
 public:
  LogitSegmenter(DecoderNetwork& decoder, ConstNetworkSpan embedding, const PromptAnswers& grid)
      : decoder_(decoder), embedding_(embedding), grid_(grid) {}

  absl::Status SetPhotograph(const Image&) override { return absl::OkStatus(); }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    std::vector<DecoderPoint> points;
    const double scale = grid_.cells_per_pixel * decoder_.frame() / kProposalExtent;
    for (const SegmenterPrompt& prompt : prompts) {
      points.push_back({static_cast<float>(prompt[0].x * scale - 0.5),
                        static_cast<float>(prompt[0].y * scale - 0.5), 1});
      points.push_back({});
    }
    DecodedMasks masks;
    const absl::Status decoded =
        decoder_.Decode(embedding_, points, 2, {grid_.width, grid_.height}, true, masks);
    if (!decoded.ok()) return decoded;
    PromptAnswers answers = grid_;
    answers.ious.resize(static_cast<size_t>(masks.ious.size()));
    masks.ious.Download(answers.ious);
    std::vector<float> logits(static_cast<size_t>(masks.logits.size()));
    masks.logits.Download(logits);
    // The rows of each square that show the photograph.
    for (size_t first = 0; first < logits.size();
         first += size_t{kProposalExtent} * kProposalExtent) {
      const auto from = logits.begin() + static_cast<ptrdiff_t>(first);
      answers.logits.insert(answers.logits.end(), from, from + kProposalExtent * kProposalHeight);
    }
    return answers;
  }

 private:
  DecoderNetwork& decoder_;
  ConstNetworkSpan embedding_;
  const PromptAnswers grid_;
};

TEST(MaskProposals, AreTheSameOnABackendAndOnTheHost) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kProposalSide, WeightsOf, *backend, Precision::kFloat));
  std::mt19937_64 engine(3);
  std::normal_distribution<float> normal;
  std::vector<float> values(size_t{kProposalSide} * kProposalSide * kPromptChannels);
  for (float& value : values) value = normal(engine);
  const NetworkBuffer embedding(*backend, Precision::kFloat, std::span<const float>(values));
  ProposalRequest request;
  request.grid.width = kProposalExtent;
  request.grid.height = kProposalHeight;
  request.grid.cells_per_pixel = 0.1;
  for (int i = 0; i < 30; ++i) {
    const PromptPoint point = {20.0F + 53 * (i % 6), 15.0F + 47 * (i / 6.0F)};
    (i < 4 ? request.always : request.unsettled).push_back(point);
  }
  request.min_filler_iou = 0.2;
  request.min_filler_stability = 0.02;
  request.min_iou = 0.7;
  request.min_stability = 0.05;

  LogitSegmenter segmenter(*decoder, embedding.span(), request.grid);
  ASSERT_OK_AND_ASSIGN(const Proposals want,
                       segmenter.Propose(request, [] { return absl::OkStatus(); }));
  ASSERT_OK_AND_ASSIGN(const Proposals got,
                       ProposeOnBackend(*backend, *decoder, embedding.span(), request));
  EXPECT_EQ(want.num_prompts, 30);
  EXPECT_EQ(got.num_prompts, 30);
  ASSERT_EQ(got.kept.size(), want.kept.size());
  int num_sure = 0;
  for (size_t i = 0; i < want.kept.size(); ++i) {
    const ProposedMask &a = got.kept[i], &b = want.kept[i];
    EXPECT_EQ(a.iou, b.iou);
    EXPECT_EQ(a.stability, b.stability);
    EXPECT_EQ(a.cell, b.cell);
    EXPECT_EQ(a.mask.area(), b.mask.area());
    EXPECT_EQ(a.mask.Common(b.mask), b.mask.area());
    EXPECT_EQ(a.quarter_logits, b.quarter_logits);
    num_sure += request.IsSure(b) ? 1 : 0;
  }
  // The case has sure masks, fillers, and masks that are dropped.
  EXPECT_GT(num_sure, 1);
  EXPECT_GT(want.kept.size(), static_cast<size_t>(num_sure));
  EXPECT_LT(want.kept.size(), 80u);
}

TEST(MaskProposals, AreNoneWithoutPoints) {
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto decoder,
                       DecoderNetwork::Make(kProposalSide, WeightsOf, *backend, Precision::kFloat));
  const NetworkBuffer embedding(*backend, Precision::kFloat,
                                int64_t{kProposalSide} * kProposalSide * kPromptChannels);
  ASSERT_OK_AND_ASSIGN(const Proposals got,
                       ProposeOnBackend(*backend, *decoder, embedding.span(), {}));
  EXPECT_EQ(got.num_prompts, 0);
  EXPECT_TRUE(got.kept.empty());
}

}  // namespace
}  // namespace pepeseg
