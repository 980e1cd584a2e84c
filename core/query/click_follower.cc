#include "core/query/click_follower.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr size_t kMostCorrections = 8;  // that are answered one after the other

// Factors of masks of equal plausibility and support.
constexpr double kFirstOfModel = 0.8;   // against the segmenter's, first click
constexpr double kLocalOfModel = 1.18;  // against the model's whole masks
constexpr double kNear = 0.37;          // of changes near the click, against connected ones
constexpr double kNextOfImage = 1.18;   // the segmenter's changed mask
constexpr double kOtherOfImage = 0.9;   // its masks of other sizes
constexpr double kLocalOfImage = 0.85;  // against its whole masks
constexpr double kLeastConfirmed = 1e-4;
constexpr double kLeastIou = 0.01;  // of the segmenter's estimates

double IouOf(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  int64_t common = 0, either = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    common += a[i] & b[i];
    either += a[i] | b[i];
  }
  return either == 0 ? 0 : static_cast<double>(common) / static_cast<double>(either);
}

bool HasPositive(const Query& query) {
  return std::find(query.positive.begin(), query.positive.end(), 1) != query.positive.end();
}

// Lets a meaning that clicks changed in a part have the query of the one before.
void KeepQuery(const PromptMeaning& before, PromptMeaning& changed) {
  changed.query = before.query;
  changed.unchanged = before.is_of_query ? before.mask : before.unchanged;
}

}  // namespace

// A mask that may become the answer.
struct ClickFollower::Option {
  std::vector<uint8_t> small;  // in the small view
  double weight = 1;           // of its kind and support
  int plateau = -1;            // of the model
  int image = -1;              // index of the segmenter's mask
  ChangeReach reach = ChangeReach::kWhole;
  double value = 0;
};

ClickFollower::ClickFollower(const Segmenter& model, ImageSegmenter* images, const ModelView& view,
                             Granularity granularity)
    : model_(model),
      images_(images),
      view_(view),
      granularity_(granularity),
      grid_(GridOf(granularity)),
      small_(SmallViewOf(view)) {}

absl::Status ClickFollower::Follow(std::span<const PointPrompt> clicks,
                                   const std::optional<BinaryMask>& previous,
                                   const WantedCheck& check) {
  RETURN_IF_ERROR(CheckPoints(ImageOf(view_), clicks, previous.has_value()));
  clicks_.assign(clicks.begin(), clicks.end());
  if (previous) TakePrevious(*previous);
  const auto first = std::find_if(clicks_.begin(), clicks_.end(),
                                  [](const PointPrompt& click) { return click.positive; });
  std::rotate(clicks_.begin(), first, first + 1);
  RETURN_IF_ERROR(ReadFeatures(images_ == nullptr && !previous));
  const size_t last = clicks_.size() - 1;
  const size_t first_answered = previous ? last : last - std::min(last, kMostCorrections);
  for (size_t i = 0; i <= last; ++i) {
    AddClick(i);
    if (i < first_answered) continue;
    RETURN_IF_ERROR(check());
    if (answer_ && IsAnswered(made_.back())) continue;
    std::vector<Option> options;
    RETURN_IF_ERROR(FindOptions(check, options));
    const Option best = answer_ ? BestChange(options) : BestFirst(options);
    if (best.value > 0) RETURN_IF_ERROR(Take(best));
  }
  if (!answer_) return TakeDefaults();
  const bool has_query = meaning_.is_of_query || !meaning_.unchanged.pixels.empty();
  if (!has_query && HasPositive(query_)) meaning_.query = whole();
  return absl::OkStatus();
}

// Takes a mask as the answer to all clicks but the last, which stays the last: a positive one comes
// before it.
void ClickFollower::TakePrevious(const BinaryMask& previous) {
  if (std::none_of(clicks_.begin(), clicks_.end() - 1,
                   [](const PointPrompt& click) { return click.positive; })) {
    const Camera& camera = view_.camera;
    BinaryMask left = previous;  // far from what is not meant
    for (const PointPrompt& click : clicks_) {
      left.pixels[static_cast<size_t>(click.y) * camera.width + static_cast<size_t>(click.x)] = 0;
    }
    const DeepPixel deepest = FindDeepest(left.pixels, camera.width, camera.height);
    clicks_.insert(clicks_.begin(), {deepest.pixel.x + 0.5, deepest.pixel.y + 0.5, true});
  }
  meaning_.mask = previous;
  small_answer_ = Small(previous.pixels);
  answer_ = SoftMask{previous, 0, {}};
}

// all_solid: a click on nothing is an error.
absl::Status ClickFollower::ReadFeatures(bool all_solid) {
  const std::span<const PointPrompt> clicks = clicks_;
  click_is_solid_.assign(clicks.size(), 1);
  if (all_solid) {
    ASSIGN_OR_RETURN(click_features_, model_.PointFeatures(view_, clicks));
    return absl::OkStatus();
  }
  std::vector<size_t> found;
  ASSIGN_OR_RETURN(const std::vector<float> features,
                   SolidFeatures(model_, view_, PixelsOf(clicks, view_.camera.width), &found));
  click_features_.assign(clicks.size() * kFeatureSize, 0);
  std::fill(click_is_solid_.begin(), click_is_solid_.end(), uint8_t{0});
  for (size_t k = 0; k < found.size(); ++k) {
    click_is_solid_[found[k]] = 1;
    std::copy_n(&features[k * kFeatureSize], kFeatureSize,
                &click_features_[found[k] * kFeatureSize]);
  }
  return absl::OkStatus();
}

void ClickFollower::AddClick(size_t index) {
  const PointPrompt& click = clicks_[index];
  made_.push_back(
      {small_.PixelAt(static_cast<int>(click.x), static_cast<int>(click.y)), click.positive});
  if (click_is_solid_[index] == 0) return;
  const auto from = click_features_.begin() + static_cast<int64_t>(index) * kFeatureSize;
  query_.features.insert(query_.features.end(), from, from + kFeatureSize);
  query_.positive.push_back(click.positive ? 1 : 0);
}

bool ClickFollower::IsIn(const PixelIndex& pixel, std::span<const uint8_t> mask) const {
  return mask[static_cast<size_t>(pixel.y) * small_.view.camera.width + pixel.x] != 0;
}

bool ClickFollower::IsAnswered(const PixelClick& click) const {
  return NumAnswered({&click, 1}, small_answer_, small_.view.camera.width) == 1;
}

Query ClickFollower::QueryAt(const Candidate& at) const {
  // A given threshold is not rounded to the grid's float.
  return {query_.features, query_.positive, at.scale,
          granularity_.threshold.value_or(at.threshold)};
}

absl::StatusOr<BinaryMask> ClickFollower::MaskOf(const Query& query) const {
  ASSIGN_OR_RETURN(auto results, model_.Segment(query, {&view_, 1}));
  return std::move(results[0].mask);
}

// Returns a mask of the view in the small view: each pixel is what is in its middle.
std::vector<uint8_t> ClickFollower::Small(std::span<const uint8_t> mask) const {
  if (small_.factor == 1) return {mask.begin(), mask.end()};
  const Camera& camera = small_.view.camera;
  std::vector<uint8_t> small;
  small.reserve(static_cast<size_t>(camera.width) * camera.height);
  const int middle = small_.factor / 2;
  for (int y = 0; y < camera.height; ++y) {
    const std::span<const uint8_t> row =
        mask.subspan(static_cast<size_t>(y * small_.factor + middle) * view_.camera.width);
    for (int x = 0; x < camera.width; ++x) small.push_back(row[x * small_.factor + middle]);
  }
  return small;
}

absl::Status ClickFollower::FindOptions(const WantedCheck& check, std::vector<Option>& options) {
  RETURN_IF_ERROR(AddModelOptions(options));
  return images_ == nullptr ? absl::OkStatus() : AddImageOptions(check, options);
}

absl::Status ClickFollower::AddModelOptions(std::vector<Option>& options) {
  plateaus_.clear();
  chosen_ = 0;
  if (!HasPositive(query_)) return absl::OkStatus();
  ASSIGN_OR_RETURN(LevelCounts counts,
                   model_.CountLevels(query_, grid_.scales, grid_.thresholds, small_.view));
  masks_.emplace(std::move(counts), grid_);
  plateaus_ = masks_->FindPlateaus(kMinArea, std::numeric_limits<int>::max());
  std::vector<Query> queries;
  for (size_t i = 0; i < std::min(plateaus_.size(), kMostPlateaus); ++i) {
    queries.push_back(QueryAt(plateaus_[i]));
  }
  if (queries.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(auto results, model_.Segment(queries, small_.view));
  for (size_t i = 0; i < results.size(); ++i) {
    options.push_back(
        {.small = std::move(results[i].mask.pixels),
         .weight = answer_ ? std::cbrt(plateaus_[i].support) : std::sqrt(plateaus_[i].support),
         .plateau = static_cast<int>(i)});
  }
  return absl::OkStatus();
}

absl::Status ClickFollower::AddImageOptions(const WantedCheck& check,
                                            std::vector<Option>& options) {
  const std::span<const PointPrompt> clicks = std::span(clicks_).first(made_.size());
  ASSIGN_OR_RETURN(seen_, images_->Click(view_, clicks, answer_ ? &*answer_ : nullptr, check));
  for (size_t i = 0; i < seen_.masks.size(); ++i) {
    if (!CheckNotEmpty(seen_.masks[i].mask).ok()) continue;
    options.push_back({.small = Small(seen_.masks[i].mask.pixels),
                       .weight = WeightOfSeen(i),
                       .image = static_cast<int>(i)});
  }
  return absl::OkStatus();
}

double ClickFollower::WeightOfSeen(size_t index) const {
  if (!answer_) return std::max(kLeastIou, seen_.masks[index].iou);
  return index == 0 ? kNextOfImage : kOtherOfImage;
}

ClickFollower::Option ClickFollower::BestFirst(std::vector<Option>& options) const {
  const int width = small_.view.camera.width;
  const auto num_of_model = static_cast<size_t>(
      std::count_if(options.begin(), options.end(), [](const Option& o) { return o.image < 0; }));
  Option* best = nullptr;
  for (Option& option : options) {
    // Where there are several clicks, masks that answer more of them come first.
    const auto answered = static_cast<double>(NumAnswered(made_, option.small, width));
    const auto last = static_cast<double>(made_.size());
    // A given scale says how large the thing is, and a given threshold how much of it is meant.
    option.value = option.weight * std::pow(0.01, last - answered) *
                   (granularity_.scale || granularity_.threshold
                        ? static_cast<double>(IsIn(made_[0].pixel, option.small))
                        : FirstClickPlausibility(made_[0].pixel, option.small, width));
    if (option.image < 0) {
      option.value *= kFirstOfModel;
    } else {
      double confirmed = num_of_model == 0 ? 1 : kLeastConfirmed;
      for (size_t i = 0; i < num_of_model; ++i) {
        const double iou = IouOf(option.small, options[i].small);
        confirmed = std::max(confirmed, iou * iou * options[i].weight);
      }
      option.value *= std::sqrt(confirmed);
    }
    if (best == nullptr || option.value > best->value) best = &option;
  }
  return best == nullptr ? Option() : std::move(*best);
}

// A plausibility is at most 1, so that options of a small weight need no look once a better one is
// found.
ClickFollower::Option ClickFollower::BestChange(std::span<const Option> wholes) const {
  struct Change {
    const Option* whole;
    ChangeReach reach;
    double weight;
  };
  std::vector<Change> changes;
  for (const Option& whole : wholes) {
    const double local = whole.weight * (whole.image < 0 ? kLocalOfModel : kLocalOfImage);
    changes.push_back({&whole, ChangeReach::kWhole, whole.weight});
    changes.push_back({&whole, ChangeReach::kConnected, local});
    changes.push_back({&whole, ChangeReach::kNear, local * kNear});
  }
  std::stable_sort(changes.begin(), changes.end(),
                   [](const Change& a, const Change& b) { return a.weight > b.weight; });
  const int width = small_.view.camera.width;
  Option best;
  for (const auto& [whole, reach, weight] : changes) {
    if (weight <= best.value) break;
    std::vector<uint8_t> small =
        ChangeMask(made_.back(), small_answer_, whole->small, width, reach);
    if (small.empty() || (reach != ChangeReach::kWhole && small == whole->small)) continue;
    const double value = weight * ClickPlausibility(made_, small_answer_, small, width);
    if (value <= best.value) continue;
    best = {std::move(small), weight, whole->plateau, whole->image, reach, value};
  }
  return best;
}

absl::Status ClickFollower::Take(const Option& option) {
  PromptMeaning taken;
  SoftMask soft;
  if (option.plateau >= 0) {
    chosen_ = static_cast<size_t>(option.plateau);
    taken.query = QueryAt(plateaus_[chosen_]);
    taken.is_of_query = true;
    if (small_.factor == 1 && option.reach == ChangeReach::kWhole) {
      taken.mask.pixels = option.small;
    } else {
      ASSIGN_OR_RETURN(taken.mask, MaskOf(taken.query));
    }
    if (option.reach != ChangeReach::kWhole) taken.image = meaning_.image;
  } else {
    soft = seen_.masks[option.image];
    taken.mask = soft.mask;
    taken.image = seen_.image;
  }
  if (option.reach != ChangeReach::kWhole) {
    const PointPrompt& click = clicks_[made_.size() - 1];
    const PixelClick at = {{static_cast<int>(click.x), static_cast<int>(click.y)}, click.positive};
    std::vector<uint8_t> changed =
        ChangeMask(at, meaning_.mask.pixels, taken.mask.pixels, view_.camera.width, option.reach);
    // The small view has the change, but the pixel itself may not.
    if (!changed.empty()) {
      taken.mask.pixels = std::move(changed);
      taken.is_of_query = false;
      KeepQuery(meaning_, taken);
      soft.logits.clear();
    }
  }
  soft.mask = taken.mask;
  answer_ = std::move(soft);
  small_answer_ = option.small;
  meaning_ = std::move(taken);
  return absl::OkStatus();
}

Query ClickFollower::DefaultQuery() const {
  Query query = {query_.features, query_.positive};
  query.scale = granularity_.scale.value_or(query.scale);
  query.threshold = granularity_.threshold.value_or(query.threshold);
  return query;
}

// Where no mask has kMinArea pixels at any scale.
absl::Status ClickFollower::TakeDefaults() {
  if (!HasPositive(query_)) return NothingThereError("SAM sees no thing at the points");
  Query query = DefaultQuery();
  ASSIGN_OR_RETURN(meaning_.mask, MaskOf(query));
  meaning_.query = std::move(query);
  meaning_.is_of_query = true;
  return absl::OkStatus();
}

Query ClickFollower::whole() const {
  return plateaus_.empty() ? DefaultQuery() : QueryAt(plateaus_[chosen_]);
}

Candidates ClickFollower::Found(int max_count) const {
  if (!masks_) return {};
  return FindCandidates(*masks_, plateaus_, chosen_, max_count);
}

}  // namespace pepeseg
