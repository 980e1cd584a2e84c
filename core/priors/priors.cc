#include "core/priors/priors.h"

#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/priors/embedded_depth.h"
#include "core/priors/embedded_masks.h"
#include "core/scene/capture.h"

namespace pepeseg {

bool AsksForSam(PriorMaker maker) {
  return maker == PriorMaker::kSam || maker == PriorMaker::kSamAndEmbedded;
}

bool ExpectsSam(PriorMaker masks, bool has_command, bool has_sam) {
  return has_sam && (AsksForSam(masks) || (masks == PriorMaker::kAuto && !has_command));
}

void VisitOptions(PriorOptions& o, OptionVisitor visit) {
  visit({"masks",
         WordsOf<PriorMaker>(&o.masks, {{"auto", PriorMaker::kAuto},
                                        {"none", PriorMaker::kNone},
                                        {"embedded", PriorMaker::kEmbedded},
                                        {"command", PriorMaker::kCommand},
                                        {"sam", PriorMaker::kSam},
                                        {"sam_and_embedded", PriorMaker::kSamAndEmbedded}})});
  visit({"depth", WordsOf<PriorMaker>(&o.depth, {{"auto", PriorMaker::kAuto},
                                                 {"none", PriorMaker::kNone},
                                                 {"embedded", PriorMaker::kEmbedded},
                                                 {"command", PriorMaker::kCommand}})});
}

absl::Status Validate(const PriorOptions& options) { return CheckOptions(options); }

EmbeddingTask::EmbeddingTask(const EmbeddedPriors& what, int num_threads, const Capture& capture)
    : what_(what), capture_(capture), opencv_threads_(cv::getNumThreads()) {
  // Views are processed in parallel, so that threads of OpenCV would only compete with these.
  cv::setNumThreads(1);
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (!capture.views[i].held_out) views_.push_back(i);
  }
  made_.resize(views_.size());
  const size_t most = std::min(views_.size(), static_cast<size_t>(NumThreads(num_threads)));
  for (size_t i = 0; i < most; ++i) {
    threads_.emplace_back([this] { Work(); });
  }
}

EmbeddingTask::~EmbeddingTask() {
  stop_.request_stop();
  threads_.clear();
  cv::setNumThreads(opencv_threads_);
}

void EmbeddingTask::Work() {
  while (!stop_.stop_requested()) {
    size_t at = 0;
    {
      const std::lock_guard lock(mutex_);
      if (next_ == views_.size()) return;
      at = next_++;
    }
    made_[at] = MadeFor(capture_.views[views_[at]]);
    {
      const std::lock_guard lock(mutex_);
      ++num_done_;
    }
    changed_.notify_all();
  }
}

// The masks are found with the depth in place, so that a view is copied.
EmbeddingTask::Made EmbeddingTask::MadeFor(const View& view) const {
  Made made;
  if (what_.depth && view.depth.values.empty()) {
    made.depth = {DepthPrior::Kind::kDepth, {}, /*from_points=*/true};
    made.depth.values = NormalizeDepth(EmbeddedDepth(view, capture_.points));
  }
  if (!what_.masks || !view.masks.empty()) return made;
  if (made.depth.values.empty()) {
    made.masks = EmbeddedMasks(view).masks;
    return made;
  }
  View with_depth = view;
  with_depth.depth = std::move(made.depth);
  made.masks = EmbeddedMasks(with_depth).masks;
  made.depth = std::move(with_depth.depth);
  return made;
}

// Returns how many views are done, once these are more, or after a while.
int EmbeddingTask::WaitForMore(int num_done) {
  constexpr auto kLongest = std::chrono::milliseconds(200);
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kLongest, [&] { return num_done_ > num_done; });
  return num_done_;
}

absl::Status EmbeddingTask::Finish(
    absl::FunctionRef<absl::Status(int done, int num_views)> progress, Capture& capture) {
  const int num_views = static_cast<int>(views_.size());
  for (int num_done = 0; num_done < num_views;) {
    num_done = WaitForMore(num_done);
    RETURN_IF_ERROR(progress(num_done, num_views));
  }
  threads_.clear();
  for (size_t i = 0; i < views_.size(); ++i) {
    View& view = capture.views[views_[i]];
    if (what_.depth && view.depth.values.empty()) view.depth = std::move(made_[i].depth);
    if (what_.masks && view.masks.empty()) view.masks = std::move(made_[i].masks);
  }
  return absl::OkStatus();
}

absl::Status EmbedPriors(const EmbeddedPriors& what, int num_threads, Capture& capture,
                         absl::FunctionRef<absl::Status(int done, int num_views)> progress) {
  return EmbeddingTask(what, num_threads, capture).Finish(progress, capture);
}

}  // namespace pepeseg
