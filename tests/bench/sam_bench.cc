// Compares and times SAM's masks by our kernels, on CUDA or on all cores, and by ONNX Runtime on
// all cores.
//   pepeseg_sam_bench SAM_FOLDER OUT [--points N] [--cpu] [--ours-only] PHOTO...
// For each photograph: masks of both and their IoUs, sure answers to the grid's prompts, and the
// time of each step on our kernels. Then the time of all photographs, from files to files of masks
// in OUT, as a training makes them.

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "core/priors/sam/automatic_masks.h"
#include "core/priors/sam/mask_proposals.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/train/photograph_masks.h"
#include "tests/bench/bench_backend.h"

namespace pepeseg {
namespace {

struct BenchOptions {
  std::filesystem::path sam, out;
  AutomaticMaskOptions masks;
  bool cpu = false, ours_only = false;
  std::vector<std::string> photos;
};

// Adds up the time of each step of another segmenter.
class TimedSegmenter : public PromptedSegmenter {
 public:
  explicit TimedSegmenter(PromptedSegmenter& segmenter) : segmenter_(segmenter) {}
  absl::Status SetPhotograph(const Image& photo) override {
    return Timed("embed", [&] { return segmenter_.SetPhotograph(photo); });
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    return segmenter_.Segment(prompts);
  }
  absl::StatusOr<Proposals> Propose(const ProposalRequest& request,
                                    absl::FunctionRef<absl::Status()> progress) override {
    return Timed("propose", [&] { return segmenter_.Propose(request, progress); });
  }
  absl::StatusOr<std::vector<ProposedMask>> Match(
      std::span<const TargetedPrompt> prompts,
      absl::FunctionRef<absl::Status()> progress) override {
    return Timed("match", [&] { return segmenter_.Match(prompts, progress); });
  }
  absl::StatusOr<std::vector<std::vector<PixelRun>>> Enlarge(std::span<const ProposedMask> masks,
                                                             const View& view) override {
    return Timed("enlarge", [&] { return segmenter_.Enlarge(masks, view); });
  }
  std::map<std::string, double> seconds;

 private:
  template <class Call>
  auto Timed(const char* step, const Call& call) -> decltype(call()) {
    const double start = Now();
    auto result = call();
    seconds[step] += Now() - start;
    return result;
  }
  PromptedSegmenter& segmenter_;
};

absl::StatusOr<AutomaticMasks> MasksOf(PromptedSegmenter& segmenter, const View& view,
                                       const BenchOptions& options) {
  return SegmentPhotograph(segmenter, view, {}, options.masks, [] { return absl::OkStatus(); });
}

// Prints how well the masks `got` repeat the masks `want`.
void PrintAgreement(const MaskSet& want, const MaskSet& got) {
  double sum = 0, worst = 1;
  int num_lost = 0;
  for (int k = 0; k < want.num_masks; ++k) {
    const BinaryMask mask = want.Extract(k);
    std::vector<int64_t> common(static_cast<size_t>(got.num_masks));
    for (size_t i = 0; i < mask.pixels.size(); ++i) {
      if (mask.pixels[i] == 0 || got.pixel_cell.empty()) continue;
      const uint64_t* bits = &got.cell_bits[static_cast<size_t>(got.pixel_cell[i]) * got.words];
      for (int m = 0; m < got.num_masks; ++m) common[m] += bits[m / 64] >> (m % 64) & 1;
    }
    double best = 0;
    for (int m = 0; m < got.num_masks; ++m) {
      const int64_t united = want.mask_area[k] + got.mask_area[m] - common[m];
      best = std::max(best, static_cast<double>(common[m]) / static_cast<double>(united));
    }
    sum += best;
    worst = std::min(worst, best);
    num_lost += best < 0.8 ? 1 : 0;
  }
  std::printf(
      "  kept %d by ONNX Runtime, %d by our kernels: best IoU mean %.5f, least %.4f, lost %d\n",
      want.num_masks, got.num_masks, sum / std::max(1, want.num_masks), worst, num_lost);
}

// Agreement of the answers to the prompts of the grids.
struct AnswerAgreement {
  std::vector<double> sure_ious;  // of ONNX Runtime's sure masks
  int num_changed = 0, num_decisions = 0;

  void Print() {
    std::sort(sure_ious.begin(), sure_ious.end());
    double sum = 0;
    for (const double iou : sure_ious) sum += iou;
    if (sure_ious.empty()) return;
    std::printf(
        "  sure answers so far: %d, IoU mean %.6f, 1 %% %.4f, least %.4f; changed: %d of %d\n",
        static_cast<int>(sure_ious.size()), sum / static_cast<double>(sure_ious.size()),
        sure_ious[sure_ious.size() / 100], sure_ious[0], num_changed, num_decisions);
  }
};

// Answers by ONNX Runtime, and compares its answers to prompts of one point with CUDA's.
class ComparedSegmenter : public PromptedSegmenter {
 public:
  ComparedSegmenter(PromptedSegmenter& onnx, PromptedSegmenter& cuda,
                    const AutomaticMaskOptions& options, AnswerAgreement& agreement)
      : onnx_(onnx), cuda_(cuda), options_(options), agreement_(agreement) {}
  absl::Status SetPhotograph(const Image& photo) override {
    RETURN_IF_ERROR(cuda_.SetPhotograph(photo));
    return onnx_.SetPhotograph(photo);
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    ASSIGN_OR_RETURN(PromptAnswers want, onnx_.Segment(prompts));
    if (prompts[0].size() > 1) return want;
    ASSIGN_OR_RETURN(const PromptAnswers got, cuda_.Segment(prompts));
    for (size_t prompt = 0; prompt < prompts.size(); ++prompt) {
      for (size_t mask = 1; mask < PromptAnswers::kMasks; ++mask) {
        const ProposedMask a = ReadMask(want, prompt, mask), b = ReadMask(got, prompt, mask);
        if (IsSure(a)) agreement_.sure_ious.push_back(a.mask.Iou(b.mask));
        const bool changed = IsSure(a) != IsSure(b) || IsFiller(a) != IsFiller(b);
        agreement_.num_changed += changed ? 1 : 0;
        ++agreement_.num_decisions;
      }
    }
    return want;
  }

 private:
  bool IsSure(const ProposedMask& mask) const {
    return mask.iou >= options_.min_iou && mask.stability >= options_.min_stability;
  }
  bool IsFiller(const ProposedMask& mask) const {
    return mask.iou >= options_.min_filler_iou && mask.stability >= options_.min_filler_stability;
  }
  PromptedSegmenter &onnx_, &cuda_;
  const AutomaticMaskOptions& options_;
  AnswerAgreement& agreement_;
};

// Seconds from the photographs' files to files of masks, as a training makes them: several
// photographs at a time. keep: also to files of embeddings.
absl::StatusOr<double> TimeFiles(SamModel& model, int num_threads, const BenchOptions& options,
                                 int rounds, bool keep) {
  std::vector<DatasetFile> files;
  for (int round = 0; round < rounds; ++round) {
    for (const std::string& photo : options.photos) {
      files.push_back({FileKind::kImage, absl::StrCat(round, "-", photo), photo});
    }
  }
  const PhotographMasks masks(options.out, 1);
  const EmbeddingOrigin origin = {model.encoder_digest(), ""};
  RETURN_IF_ERROR(masks.Prepare());
  std::atomic<size_t> next = 0;
  std::atomic<int> num_failed = 0;
  const double start = Now();
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < SamPhotographsAtOnce(num_threads, model.on_device()); ++i) {
      threads.emplace_back([&] {
        const auto segmenter = model.MakeSegmenter();
        for (size_t k = next++; k < files.size(); k = next++) {
          num_failed += masks.Make(k, files[k], *segmenter, keep ? &origin : nullptr).ok() ? 0 : 1;
        }
      });
    }
  }
  const double seconds = Now() - start;
  if (num_failed > 0) return absl::InternalError("a photograph failed");
  return seconds / static_cast<double>(files.size());
}

absl::StatusOr<View> ReadView(const std::string& photo) {
  View view;
  ASSIGN_OR_RETURN(view.photo, DecodePhoto(photo, photo));
  return view;
}

absl::Status RunOurs(SamModel& ours, const BenchOptions& options, std::vector<MaskSet>& made) {
  const int rounds = options.cpu ? 1 : 10;
  const auto segmenter = ours.MakeSegmenter();
  for (const std::string& photo : options.photos) {
    ASSIGN_OR_RETURN(const View view, ReadView(photo));
    RETURN_IF_ERROR(MasksOf(*segmenter, view, options).status());
    TimedSegmenter timed(*segmenter);
    AutomaticMasks masks;
    const double start = Now();
    for (int round = 0; round < rounds; ++round) {
      ASSIGN_OR_RETURN(masks, MasksOf(timed, view, options));
    }
    std::printf("%s, %d x %d: %d masks, %d prompts, %.2f ms:", photo.c_str(), view.photo.width,
                view.photo.height, masks.masks.num_masks, masks.num_prompts,
                (Now() - start) * 1e3 / rounds);
    for (const auto& [step, seconds] : timed.seconds) {
      std::printf(" %s %.2f", step.c_str(), seconds * 1e3 / rounds);
    }
    std::printf("\n");
    made.push_back(std::move(masks.masks));
  }
  return absl::OkStatus();
}

absl::Status Compare(SamModel& ours, SamModel& onnx, const BenchOptions& options,
                     const std::vector<MaskSet>& made) {
  const auto by_ours = ours.MakeSegmenter(), on_cpu = onnx.MakeSegmenter();
  AnswerAgreement agreement;
  ComparedSegmenter compared(*on_cpu, *by_ours, options.masks, agreement);
  for (size_t k = 0; k < options.photos.size(); ++k) {
    ASSIGN_OR_RETURN(const View view, ReadView(options.photos[k]));
    ASSIGN_OR_RETURN(const AutomaticMasks want, MasksOf(compared, view, options));
    std::printf("%s\n", options.photos[k].c_str());
    PrintAgreement(want.masks, made[k]);
    agreement.Print();
  }
  return absl::OkStatus();
}

absl::Status Run(const BenchOptions& options) {
  const auto core_seconds = [&](double since, int rounds) {
    return (CoreNow() - since) / (rounds * static_cast<double>(options.photos.size()));
  };
  const int num_threads = NumThreads(0);
  double start = Now();
  SamOptions open = {.num_threads = num_threads};
  if (!options.cpu) open.cuda_device = 0;
  ASSIGN_OR_RETURN(const auto ours, SamModel::Open(options.sam, open));
  std::printf("%s opened in %.2f s\n", ours->processor().c_str(), Now() - start);
  std::vector<MaskSet> made;
  RETURN_IF_ERROR(RunOurs(*ours, options, made));
  const int rounds = options.cpu ? 1 : 20;
  double core_start = 0, by_ours = 0;
  // In turn, so that other load of the machine meets both.
  for (const bool keep : {false, true, false, true}) {
    core_start = CoreNow();
    ASSIGN_OR_RETURN(by_ours, TimeFiles(*ours, num_threads, options, rounds, keep));
    std::printf(
        "files to files by our kernels, %d threads%s: %.2f ms per photograph, %.2f core s\n",
        num_threads, keep ? ", with embeddings" : "", by_ours * 1e3,
        core_seconds(core_start, rounds));
  }
  std::printf("device memory: %.0f MiB\n",
              static_cast<double>(ours->peak_device_bytes()) / (1 << 20));
  if (options.ours_only) return absl::OkStatus();
  start = Now();
  open = {.num_threads = num_threads, .onnx_runtime = true};
  ASSIGN_OR_RETURN(const auto onnx, SamModel::Open(options.sam, open));
  std::printf("%s opened in %.2f s\n", onnx->processor().c_str(), Now() - start);
  core_start = CoreNow();
  ASSIGN_OR_RETURN(const double by_onnx, TimeFiles(*onnx, num_threads, options, 1, false));
  std::printf(
      "files to files by ONNX Runtime, %d threads: %.1f ms per photograph, %.2f core s, %.1f times "
      "ours\n",
      num_threads, by_onnx * 1e3, core_seconds(core_start, 1), by_onnx / by_ours);
  return Compare(*ours, *onnx, options, made);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  pepeseg::BenchOptions options;
  std::vector<std::string> rest;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--ours-only") {
      options.ours_only = true;
    } else if (word == "--cpu") {
      options.cpu = true;
    } else if (word == "--points" && i + 1 < argc) {
      if (!absl::SimpleAtoi(argv[++i], &options.masks.points_per_side)) return 2;
    } else {
      rest.push_back(word);
    }
  }
  if (rest.size() < 3) {
    std::printf("usage: %s SAM_FOLDER OUT [--points N] [--cpu] [--ours-only] PHOTO...\n", argv[0]);
    return 2;
  }
  options.masks.join_embedded = false;
  options.sam = rest[0];
  options.out = rest[1];
  options.photos.assign(rest.begin() + 2, rest.end());
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::printf("%s\n", status.ToString().c_str());
  return status.ok() ? 0 : 1;
}
