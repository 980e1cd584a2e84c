#include "core/priors/priors.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/embedded_depth.h"
#include "core/priors/embedded_masks.h"
#include "core/scene/capture.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

// Restricts OpenCV to one thread for its lifetime: views are processed in parallel, so that threads
// of OpenCV would only compete with ours.
class OneOpenCvThread {
 public:
  OneOpenCvThread() { cv::setNumThreads(1); }
  ~OneOpenCvThread() { cv::setNumThreads(before_); }
  OneOpenCvThread(const OneOpenCvThread&) = delete;
  OneOpenCvThread& operator=(const OneOpenCvThread&) = delete;

 private:
  const int before_ = cv::getNumThreads();
};

void EmbedIn(const EmbeddedPriors& what, std::span<const ScenePoint> points, View& view) {
  if (what.depth && view.depth.values.empty()) {
    view.depth = {DepthPrior::Kind::kDepth, {}, /*from_points=*/true};
    view.depth.values = NormalizeDepth(EmbeddedDepth(view, points));
  }
  if (what.masks && view.masks.empty()) view.masks = EmbeddedMasks(view).masks;
}

}  // namespace

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

// Works on as many views at a time as the pool has threads, so that progress is reported, and can
// end the call, between two groups.
absl::Status EmbedPriors(const EmbeddedPriors& what, int num_threads, Capture& capture,
                         absl::FunctionRef<absl::Status(int done, int num_views)> progress) {
  std::vector<View*> views;
  for (View& view : capture.views) {
    if (!view.held_out) views.push_back(&view);
  }
  const OneOpenCvThread one_thread;
  ThreadPool pool(num_threads);
  const size_t at_once = pool.num_threads();
  for (size_t first = 0; first < views.size(); first += at_once) {
    const size_t count = std::min(at_once, views.size() - first);
    pool.ParallelFor(static_cast<int64_t>(count), [&](int64_t i, int) {
      EmbedIn(what, capture.points, *views[first + static_cast<size_t>(i)]);
    });
    RETURN_IF_ERROR(progress(static_cast<int>(first + count), static_cast<int>(views.size())));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
