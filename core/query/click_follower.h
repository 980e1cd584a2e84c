#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/click_plausibility.h"
#include "core/query/image_segmenter.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/query/prompt_meaning.h"
#include "core/query/segmenter.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Follows clicks in a view, in their order (METHOD.md section 4, "Points"). The first positive
// click comes first. Of more than 9 clicks, all but the last 8 are answered together, which bounds
// the time.
//
// The answer to the first click is the mask with the largest product of the click's plausibility (1
// where a scale or a threshold is given) and
// - for a mask of the model, 0.8 times the root of its support,
// - for a mask of the image segmenter, its estimated IoU times the root of how much the model
//   confirms it: the largest squared IoU with a mask of the model times the root of that one's
//   support.
// Each further click changes the answer into the mask with the largest product of plausibility, the
// cube root of the support (1 for the segmenter's) and a factor of its kind. The masks are those of
// all clicks so far and, for each, the answer changed to it around the click alone (ChangeReach). A
// click that the answer answers, or no mask, changes nothing.
class ClickFollower {
 public:
  // images: null: the model answers alone. Both must outlive the follower.
  ClickFollower(const Segmenter& model, ImageSegmenter* images, const ModelView& view,
                Granularity granularity);

  // Follows all clicks or, with the answer to all but the last one, only that one; is
  // called once. Where then no other click is positive, the pixel of `previous` that is
  // farthest from its border and from the clicks counts as one.
  // Returns the errors of Segmenter::PointFeatures, but for
  // clicks on nothing where there is an image segmenter; NothingThereError where that one sees
  // nothing, either; and the errors of both segmenters and of `check`, which is called before each
  // click.
  absl::Status Follow(std::span<const PointPrompt> clicks,
                      const std::optional<BinaryMask>& previous, const WantedCheck& check);

  const PromptMeaning& meaning() const { return meaning_; }
  // Returns the query of all clicks at the scale and threshold that the last answer of the model
  // came from.
  Query whole() const;
  // Returns what the clicks may mean, at most `max_count` masks of the model, the best of which is
  // the last one that the answer came from. None: no mask has kMinArea pixels at any scale.
  Candidates Found(int max_count) const;
  // The features of all clicks; its scale and threshold are not used.
  const Query& features() const { return query_; }

 private:
  struct Option;

  void TakePrevious(const BinaryMask& previous);
  absl::Status ReadFeatures(bool all_solid);
  void AddClick(size_t index);
  absl::Status FindOptions(const WantedCheck& check, std::vector<Option>& options);
  absl::Status AddModelOptions(std::vector<Option>& options);
  absl::Status AddImageOptions(const WantedCheck& check, std::vector<Option>& options);
  double WeightOfSeen(size_t index) const;
  Option BestFirst(std::vector<Option>& options) const;
  Option BestChange(std::span<const Option> wholes) const;
  absl::Status Take(const Option& option);
  absl::Status TakeDefaults();
  absl::StatusOr<BinaryMask> MaskOf(const Query& query) const;
  Query QueryAt(const Candidate& at) const;
  Query DefaultQuery() const;
  std::vector<uint8_t> Small(std::span<const uint8_t> mask) const;
  bool IsAnswered(const PixelClick& click) const;
  bool IsIn(const PixelIndex& pixel, std::span<const uint8_t> mask) const;

  const Segmenter& model_;
  ImageSegmenter* const images_;
  const ModelView view_;
  const Granularity granularity_;
  const GranularityGrid grid_;
  const SmallView small_;
  PointsPrompt clicks_;                  // the first positive one first
  std::vector<float> click_features_;    // [clicks_, 32]
  std::vector<uint8_t> click_is_solid_;  // [clicks_] 0: the model shows nothing there

  // State after the clicks so far.
  std::vector<PixelClick> made_;  // in the small view
  Query query_;                   // features of those that are solid
  std::optional<MaskGrid> masks_;
  std::vector<Candidate> plateaus_;
  size_t chosen_ = 0;               // plateau
  ImageMasks seen_;                 // by the segmenter, at the last click
  std::optional<SoftMask> answer_;  // absent: none yet
  std::vector<uint8_t> small_answer_;
  PromptMeaning meaning_;
};

}  // namespace pepeseg
