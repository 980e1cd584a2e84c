#include "tests/bench/click_times.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/prompted_thing.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {
namespace {

struct Answer {
  double ms = 0, core_ms = 0;
  BinaryMask mask;
};
using Times = std::vector<Answer>;

absl::StatusOr<Answer> AnswerTimed(const Segmenter& segmenter, ImageSegmenter* images,
                                   const Prompt& prompt) {
  const auto go_on = [] { return absl::OkStatus(); };
  const double start = NowMs(), core_start = CoreNow();
  ASSIGN_OR_RETURN(PromptedThing thing, PromptedThing::Find(segmenter, images, prompt, {}, go_on));
  ASSIGN_OR_RETURN(SegmentResult result, thing.In(prompt.view, {.refine_borders = true}, go_on));
  return Answer{NowMs() - start, 1e3 * (CoreNow() - core_start), std::move(result.mask)};
}

void PrintTimes(const char* how, Times times) {
  if (times.empty()) return;
  const auto at = [&](double Answer::*value, double share) {
    const size_t i = static_cast<size_t>(share * static_cast<double>(times.size() - 1));
    std::nth_element(times.begin(), times.begin() + static_cast<int64_t>(i), times.end(),
                     [&](const Answer& a, const Answer& b) { return a.*value < b.*value; });
    return times[i].*value;
  };
  std::printf("#   %s: %.1f ms, 90 %%: %.1f, core: %.1f; of %zu\n", how, at(&Answer::ms, 0.5),
              at(&Answer::ms, 0.9), at(&Answer::core_ms, 0.5), times.size());
}

}  // namespace

absl::Status PrintClickTimes(const Segmenter& segmenter, ImageSegmenter* images,
                             const EvaluationTask& task, const EvaluationResult& clicks) {
  std::array<Times, kNumEarlyClicks> together, one_by_one;
  for (size_t i = 0; i < task.entities.size(); ++i) {
    const std::optional<EntityClicks>& made = clicks.entities[i].clicks;
    if (!made) continue;
    const ModelView& view = task.views[task.entities[i].reference].view;
    PointsPrompt points;
    std::optional<BinaryMask> before;
    for (size_t k = 0; k < std::min(made->answers.size(), together.size()); ++k) {
      if (made->answers[k].on_nothing) break;
      points.push_back(made->answers[k].click);
      if (k == 0) RETURN_IF_ERROR(AnswerTimed(segmenter, images, {view, points}).status());
      ASSIGN_OR_RETURN(Answer all, AnswerTimed(segmenter, images, {view, points}));
      if (before) {
        ASSIGN_OR_RETURN(Answer last, AnswerTimed(segmenter, images, {view, points, before}));
        one_by_one[k].push_back(std::move(last));
      }
      before = all.mask;
      together[k].push_back(std::move(all));
    }
  }
  std::printf("# clicks%s\n", images != nullptr ? " by SAM and the model" : " by the model");
  for (size_t k = 0; k < together.size(); ++k) {
    PrintTimes(("click " + std::to_string(k + 1)).c_str(), together[k]);
    PrintTimes(("click " + std::to_string(k + 1) + " with the mask before").c_str(), one_by_one[k]);
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
