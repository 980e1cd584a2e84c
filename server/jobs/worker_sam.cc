#include "server/jobs/worker_sam.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/io/atomic_file.h"
#include "core/io/mask_files.h"
#include "core/io/rle.h"
#include "core/priors/sam/automatic_masks.h"
#include "core/priors/sam/sam_needs.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/status_macros.h"
#include "server/jobs/file_error.h"
#include "server/jobs/worker_limits.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// As SAM's automatic mask generator writes them, which mask_files.h reads.
std::string ToSamJson(const MaskSet& masks) {
  nlohmann::json list = nlohmann::json::array();
  for (int k = 0; k < masks.num_masks; ++k) {
    const std::string counts = EncodeCocoRle(masks.Extract(k), masks.width, masks.height);
    list.push_back({{"segmentation", {{"size", {masks.height, masks.width}}, {"counts", counts}}}});
  }
  return list.dump();
}

class ViewSegmentation {
 public:
  ViewSegmentation(const WorkerJob& job, bool join, Capture& capture)
      : job_(job), capture_(capture), folder_(job.folder.priors() / "sam") {
    options_.join_embedded = join;
  }

  absl::Status Run(StageLog& stages);

 private:
  fs::path File(size_t view) const { return folder_ / absl::StrFormat("%06d.json", view + 1); }
  std::optional<MaskSet> Kept(size_t view) const;
  absl::StatusOr<MaskSet> Segment(size_t view);
  absl::Status OpenSegmenter();

  const WorkerJob& job_;
  Capture& capture_;
  const fs::path folder_;
  AutomaticMaskOptions options_;
  std::unique_ptr<PromptedSegmenter> segmenter_;  // null until the first photograph needs it
};

// The masks that an earlier attempt has made. A damaged file is as none.
std::optional<MaskSet> ViewSegmentation::Kept(size_t view) const {
  std::error_code ignored;
  if (!fs::is_regular_file(fs::symlink_status(File(view), ignored))) return std::nullopt;
  const Image& photo = capture_.views[view].photo;
  auto masks = ReadMasks(File(view), File(view).filename().string(),
                         {capture_.views[view].name, photo.width, photo.height});
  if (!masks.ok()) return std::nullopt;
  return *std::move(masks);
}

absl::Status ViewSegmentation::OpenSegmenter() {
  if (segmenter_ != nullptr) return absl::OkStatus();
  const int num_threads = job_.spec.num_threads > 0
                              ? job_.spec.num_threads
                              : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  ASSIGN_OR_RETURN(segmenter_, OpenSam(job_.sam, num_threads));
  std::error_code error;
  fs::create_directories(folder_, error);
  return error ? FileError(folder_, "create", error.value()) : absl::OkStatus();
}

absl::StatusOr<MaskSet> ViewSegmentation::Segment(size_t index) {
  RETURN_IF_ERROR(OpenSegmenter());
  const View& view = capture_.views[index];
  const auto poll = [this] {
    return job_.stop.stop ? absl::CancelledError("stopped while SAM ran") : absl::OkStatus();
  };
  ASSIGN_OR_RETURN(AutomaticMasks made,
                   SegmentPhotograph(*segmenter_, view, view.masks, options_, poll));
  RETURN_IF_ERROR(WriteFileAtomically(File(index), ToSamJson(made.masks)));
  return std::move(made.masks);
}

absl::Status ViewSegmentation::Run(StageLog& stages) {
  std::vector<size_t> trained;
  for (size_t i = 0; i < capture_.views.size(); ++i) {
    if (!capture_.views[i].held_out) trained.push_back(i);
  }
  std::vector<MaskSet> made;
  int64_t num_kept = 0;
  for (const size_t view : trained) {
    if (std::optional<MaskSet> kept = Kept(view)) {
      made.push_back(*std::move(kept));
      ++num_kept;
      continue;
    }
    ASSIGN_OR_RETURN(MaskSet masks, Segment(view));
    made.push_back(std::move(masks));
    const auto done = static_cast<double>(made.size()) / static_cast<double>(trained.size());
    RETURN_IF_ERROR(stages.Step({.stage = "priors",
                                 .step = static_cast<int64_t>(made.size()),
                                 .num_steps = static_cast<int64_t>(trained.size()),
                                 .activity = "segmenting",
                                 .unit = "photographs",
                                 .share = kShareBeforeSam + (1 - kShareBeforeSam) * done}));
  }
  if (num_kept > 0) {
    spdlog::info("SAM: {} photographs were segmented by an earlier attempt", num_kept);
  }
  for (size_t i = 0; i < trained.size(); ++i) {
    capture_.views[trained[i]].masks = std::move(made[i]);
  }
  return absl::OkStatus();
}

}  // namespace

bool UsesSam(const WorkerJob& job, PriorMaker masks) {
  return !job.sam.empty() && (masks == PriorMaker::kAuto || AsksForSam(masks));
}

absl::Status SegmentViews(const WorkerJob& job, PriorMaker masks, StageLog& stages,
                          Capture& capture) {
  absl::Status status = [&] {
    try {
      return ViewSegmentation(job, masks == PriorMaker::kSamAndEmbedded, capture).Run(stages);
    } catch (const std::bad_alloc&) {  // of the standard library or OpenCV
      return absl::ResourceExhaustedError("out of memory");
    }
  }();
  if (!absl::IsResourceExhausted(status)) return status;
  return absl::ResourceExhaustedError(absl::StrCat(
      "SAM: out of memory: it needs about ", kSamHostBytes >> 20,
      " MiB besides the photographs, and the job may take ", MemoryLimit() >> 20, " MiB"));
}

}  // namespace pepeseg
