#include "core/priors/sam/device_sam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/priors/sam/automatic_masks.h"
#include "core/priors/sam/cpu_sam.h"
#include "core/priors/sam/mask_proposals.h"
#include "tests/core/priors/sam/small_sam.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/failing_allocations.h"
#include "tests/testing/status_testing.h"

// Photographs segmented on a backend's kernels, by small networks of random weights.

namespace pepeseg {
namespace {

// Thresholds at which random networks have sure masks, fillers and remainders.
AutomaticMaskOptions SmallOptions() {
  AutomaticMaskOptions options;
  options.points_per_side = 4;
  options.min_iou = 0.7;
  options.min_stability = 0.05;
  options.min_filler_iou = 0.2;
  options.min_filler_stability = 0.02;
  options.min_remainder_iou = 0.1;
  return options;
}

absl::StatusOr<AutomaticMasks> Made(PromptedSegmenter& segmenter, const View& view) {
  return SegmentPhotograph(segmenter, view, {}, SmallOptions(), [] { return absl::OkStatus(); });
}

void ExpectSameMasks(const MaskSet& a, const MaskSet& b) {
  EXPECT_EQ(a.mask_area, b.mask_area);
  EXPECT_EQ(a.pixel_cell, b.pixel_cell);
  EXPECT_EQ(a.cell_bits, b.cell_bits);
}

double Iou(const BinaryMask& a, const BinaryMask& b) {
  double common = 0, united = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    common += a.pixels[i] & b.pixels[i];
    united += a.pixels[i] | b.pixels[i];
  }
  return common / united;
}

class DeviceSamTest : public SmallSamTest {};
INSTANTIATE_TEST_SUITE_P(Backends, DeviceSamTest,
                         ::testing::Values(BackendCase{"Cpu", MakeTwoThreads},
                                           BackendCase{"Cuda", MakeCuda}),
                         BackendName);

// Forwards the network's answers; the steps are those of the host.
class HostSteps : public PromptedSegmenter {
 public:
  explicit HostSteps(std::unique_ptr<PromptedSegmenter> segmenter)
      : segmenter_(std::move(segmenter)) {}
  int extent() const override { return segmenter_->extent(); }
  absl::Status SetPhotograph(const Image& photo) override {
    return segmenter_->SetPhotograph(photo);
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    num_several += prompts[0].size() > 1 ? 1 : 0;
    return segmenter_->Segment(prompts);
  }
  int num_several = 0;

 private:
  std::unique_ptr<PromptedSegmenter> segmenter_;
};

TEST_P(DeviceSamTest, TakesTheStepsOfTheHost) {
  View view = SmallView(200, 150, 1);
  view.ignore.assign(200 * 150, 0);
  for (int i = 0; i < 200 * 40; ++i) view.ignore[i] = i % 200 > 120 ? 1 : 0;
  HostSteps host(sam_->MakeSegmenter());
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks want, Made(host, view));
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks got, Made(*sam_->MakeSegmenter(), view));
  EXPECT_EQ(got.num_prompts, want.num_prompts);
  if (sam_->backend().memory().is_host) {
    ExpectSameMasks(got.masks, want.masks);
  } else {
    // CUDA rounds logits to Halves before it compares them or makes bytes of them.
    ASSERT_EQ(got.masks.num_masks, want.masks.num_masks);
    for (int k = 0; k < want.masks.num_masks; ++k) {
      EXPECT_GT(Iou(got.masks.Extract(k), want.masks.Extract(k)), 0.995) << k;
    }
  }
  // The case has masks and remainders.
  EXPECT_GT(want.masks.num_masks, 3);
  EXPECT_GT(host.num_several, 0);
}

TEST_P(DeviceSamTest, SegmentsAPhotographTheSameAloneAndNextToOthers) {
  const std::vector<View> views = {SmallView(200, 150, 1), SmallView(90, 160, 2),
                                   SmallView(128, 128, 3)};
  std::vector<MaskSet> alone(views.size()), together(views.size());
  for (size_t k = 0; k < views.size(); ++k) {
    ASSERT_OK_AND_ASSIGN(AutomaticMasks made, Made(*sam_->MakeSegmenter(), views[k]));
    alone[k] = std::move(made.masks);
    EXPECT_GT(alone[k].num_masks, 0);
  }
  {
    std::vector<std::jthread> threads;
    for (size_t k = 0; k < views.size(); ++k) {
      threads.emplace_back([&, k] {
        const auto segmenter = sam_->MakeSegmenter();
        for (int round = 0; round < 2; ++round) {
          auto made = Made(*segmenter, views[k]);
          if (made.ok()) together[k] = std::move(made->masks);
        }
      });
    }
  }
  for (size_t k = 0; k < views.size(); ++k) ExpectSameMasks(together[k], alone[k]);
}

TEST_P(DeviceSamTest, EndsCallsOnInterrupt) {
  const View view = SmallView(200, 150, 1);
  const auto segmenter = sam_->MakeSegmenter();
  ASSERT_OK(Made(*segmenter, view));
  absl::Status status;
  {
    const std::jthread thread([&] {
      while (status.ok()) status = Made(*segmenter, view).status();
    });
    sam_->Interrupt();
  }
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_TRUE(absl::IsCancelled(segmenter->SetPhotograph(view.photo)));
}

// As a training does: another backend of the device records and runs sequences meanwhile.
TEST(DeviceSamNextToTraining, HasTheSameMasks) {
  auto sam_backend = MakeCuda();
  const auto training = MakeCuda();
  if (sam_backend == nullptr || training == nullptr) {
    if (HasFailure()) FAIL();
    GTEST_SKIP() << "this machine has no Cuda";
  }
  const auto sam = MakeSmallSam(std::move(sam_backend));
  const View view = SmallView(200, 150, 1);
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks alone, Made(*sam->MakeSegmenter(), view));
  {
    const std::jthread thread([&training](const std::stop_token& stop) {
      for (int step = 0; !stop.stop_requested(); ++step) {
        // Sizes that grow: memory is allocated while a sequence is recorded.
        Buffer<float> values(*training, 1000 + step), copy;
        training->Sequence(0, [&] {
          copy = Buffer<float>(*training, 1000 + step);
          training->Copy(copy.span().data, values.span().data, 4000);
        });
        if (step % 8 == 0) training->Sync();
      }
    });
    for (int round = 0; round < 5; ++round) {
      ASSERT_OK_AND_ASSIGN(const AutomaticMasks made, Made(*sam->MakeSegmenter(), view));
      ExpectSameMasks(made.masks, alone.masks);
    }
  }
  training->Sync();
  EXPECT_EQ(training->error(), "");
  // Each counts what the other has in use as taken.
  EXPECT_LE(training->memory().free_bytes,
            training->memory().total_bytes - static_cast<int64_t>(sam->backend().bytes_in_use()));
}

absl::StatusOr<std::unique_ptr<DeviceSam>> OpenSmallSam() {
  return MakeSmallSam(MakeCpuBackend(1));
}

TEST(CpuSam, MakesTheMasksOfItsNetworks) {
  const View view = SmallView(200, 150, 1);
  ASSERT_OK_AND_ASSIGN(const auto sam, CpuSam::Make(OpenSmallSam));
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks got, Made(*sam->MakeSegmenter(), view));
  const auto device = MakeSmallSam(MakeTwoThreads());
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks want, Made(*device->MakeSegmenter(), view));
  EXPECT_GT(got.masks.num_masks, 3);
  ExpectSameMasks(got.masks, want.masks);
}

TEST(CpuSam, OpensNetworksOnlyForSegmentersAtTheSameTime) {
  int num_opened = 0;
  ASSERT_OK_AND_ASSIGN(const auto sam, CpuSam::Make([&] {
                         ++num_opened;
                         return OpenSmallSam();
                       }));
  const View view = SmallView(90, 160, 2);
  for (int round = 0; round < 3; ++round) ASSERT_OK(Made(*sam->MakeSegmenter(), view));
  EXPECT_EQ(num_opened, 1);
  const auto first = sam->MakeSegmenter(), second = sam->MakeSegmenter();
  ASSERT_OK(Made(*first, view));
  ASSERT_OK(Made(*second, view));
  EXPECT_EQ(num_opened, 2);
}

TEST(CpuSam, ReportsWhyNetworksDoNotOpen) {
  bool opens = true;
  ASSERT_OK_AND_ASSIGN(const auto sam, CpuSam::Make([&]() {
                         return opens ? OpenSmallSam() : absl::ResourceExhaustedError("no memory");
                       }));
  const View view = SmallView(90, 160, 2);
  const auto first = sam->MakeSegmenter(), second = sam->MakeSegmenter();
  ASSERT_OK(first->SetPhotograph(view.photo));
  opens = false;
  EXPECT_TRUE(absl::IsResourceExhausted(second->SetPhotograph(view.photo)));
  EXPECT_TRUE(absl::IsResourceExhausted(CpuSam::Make([] {
                                          return absl::StatusOr<std::unique_ptr<DeviceSam>>(
                                              absl::ResourceExhaustedError("no memory"));
                                        }).status()));
}

TEST(CpuSam, EndsCallsOfAllSegmentersOnInterrupt) {
  const View view = SmallView(90, 160, 2);
  ASSERT_OK_AND_ASSIGN(const auto sam, CpuSam::Make(OpenSmallSam));
  const auto before = sam->MakeSegmenter(), after = sam->MakeSegmenter();
  ASSERT_OK(before->SetPhotograph(view.photo));
  sam->Interrupt();
  EXPECT_TRUE(absl::IsCancelled(Made(*before, view).status()));
  EXPECT_TRUE(absl::IsCancelled(after->SetPhotograph(view.photo)));
}

// Each allocation of a photograph fails in turn, and all after it.
TEST(DeviceSamMemory, IsOutOfMemoryForOneCall) {
  const auto sam = MakeSmallSam(MakeTwoThreads());
  const View view = SmallView(200, 150, 1);
  bool failed = true;
  for (int allowed = 0; failed; allowed += 7) {
    SCOPED_TRACE(allowed);
    ASSERT_LT(allowed, 400) << "the last allocation was never reached";
    const auto segmenter = sam->MakeSegmenter();
    allocations_left = allowed;
    const absl::Status status = Made(*segmenter, view).status();
    allocations_left = kUnlimited;
    failed = !status.ok();
    EXPECT_TRUE(status.ok() || absl::IsResourceExhausted(status)) << status;
  }
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks after, Made(*sam->MakeSegmenter(), view));
  const auto other = MakeSmallSam(MakeTwoThreads());
  ASSERT_OK_AND_ASSIGN(const AutomaticMasks want, Made(*other->MakeSegmenter(), view));
  ExpectSameMasks(after.masks, want.masks);
}

TEST(DeviceSamMemory, IsOutOfMemoryForOneMaskPrompt) {
  const Image photo = SmallView(200, 150, 1).photo;
  const auto sam = MakeSmallSam(MakeTwoThreads());
  const auto first = sam->MakeSegmenter();
  ASSERT_OK(first->SetPhotograph(photo));
  ASSERT_OK_AND_ASSIGN(const SamEmbedding embedding, first->Embedding());
  const MaskPrompt prompt = SmallMaskPrompt(photo, first->extent());
  bool failed = true;
  int num_failures = 0;
  for (int allowed = 0; failed; ++allowed) {
    SCOPED_TRACE(allowed);
    ASSERT_LT(allowed, 100) << "the last allocation was never reached";
    const auto segmenter = sam->MakeSegmenter();
    allocations_left = allowed;
    absl::Status status = segmenter->SetEmbedding(embedding);
    if (status.ok()) status = segmenter->SegmentByMask(prompt).status();
    allocations_left = kUnlimited;
    failed = !status.ok();
    num_failures += failed ? 1 : 0;
    EXPECT_TRUE(status.ok() || absl::IsResourceExhausted(status)) << status;
  }
  EXPECT_GT(num_failures, 5);
  const auto other = MakeSmallSam(MakeTwoThreads());
  const auto second = other->MakeSegmenter();
  ASSERT_OK(first->SetEmbedding(embedding));
  ASSERT_OK(second->SetEmbedding(embedding));
  ASSERT_OK_AND_ASSIGN(const PromptAnswers after, first->SegmentByMask(prompt));
  ASSERT_OK_AND_ASSIGN(const PromptAnswers want, second->SegmentByMask(prompt));
  EXPECT_EQ(after.logits, want.logits);
}

TEST(DeviceSamFiles, MustBeOnAMachineWithTheDevice) {
  const auto opened = DeviceSam::Open("/nowhere", 1000);
  EXPECT_TRUE(absl::IsUnavailable(opened.status())) << opened.status();
}

}  // namespace
}  // namespace pepeseg
