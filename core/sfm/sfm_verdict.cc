#include "core/sfm/sfm_verdict.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"

namespace pepeseg {
namespace {

// A photograph with fewer features shows too little. Sharp ones have thousands, unless they show a
// bare wall; 15 matches suffice to connect two photographs.
constexpr int64_t kFewFeatures = 100;
constexpr size_t kLeastRegistered = 3;
// A second model with at least this share of the photographs is a second place.
constexpr double kLargeGroup = 0.25;
constexpr size_t kNamed = 5;  // names in a message, at most
// A photograph with less than this share of the median number of features is blurred, say, if it
// has no pose either.
constexpr double kFewOfMedian = 0.25;

// Returns the names of the photographs for a message: the first kNamed, then "...".
std::string Names(const SfmEvidence& evidence, const std::vector<size_t>& photographs) {
  std::string text;
  for (size_t i = 0; i < std::min(photographs.size(), kNamed); ++i) {
    absl::StrAppend(&text, i == 0 ? "" : ", ", evidence.names[photographs[i]]);
  }
  if (photographs.size() > kNamed) absl::StrAppend(&text, ", ...");
  return text;
}

// Returns the number of photographs that must have a pose.
size_t NumNeeded(const SfmEvidence& evidence, const SfmOptions& options) {
  const double share = options.min_registered_share * static_cast<double>(evidence.names.size());
  return std::max(kLeastRegistered, static_cast<size_t>(std::ceil(share)));
}

std::vector<size_t> WithFewFeatures(const SfmEvidence& evidence) {
  std::vector<size_t> few;
  for (size_t i = 0; i < evidence.num_features.size(); ++i) {
    if (evidence.num_features[i] < kFewFeatures) few.push_back(i);
  }
  return few;
}

std::vector<size_t> Without(const std::vector<size_t>& photographs,
                            const std::vector<size_t>& others) {
  const std::set<size_t> left_out(others.begin(), others.end());
  std::vector<size_t> rest;
  for (const size_t photograph : photographs) {
    if (!left_out.contains(photograph)) rest.push_back(photograph);
  }
  return rest;
}

// Returns the photographs of a second place: those of a further model that the largest lacks, if
// there are enough of them. Empty: there is no second place.
std::vector<size_t> SecondGroup(const SfmEvidence& evidence) {
  const double least = std::max(static_cast<double>(kLeastRegistered),
                                kLargeGroup * static_cast<double>(evidence.names.size()));
  for (size_t i = 1; i < evidence.models.size(); ++i) {
    std::vector<size_t> own = Without(evidence.models[i], evidence.models[0]);
    if (static_cast<double>(own.size()) >= least) return own;
  }
  return {};
}

// Returns the photographs without a pose in the largest model.
std::vector<size_t> Unregistered(const SfmEvidence& evidence) {
  std::vector<size_t> all(evidence.names.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  return evidence.models.empty() ? all : Without(all, evidence.models[0]);
}

// Photographs without a pose, by the likely cause.
struct Unplaced {
  std::vector<size_t> blurred;  // or dark, or of bare surfaces: they have few features
  std::vector<size_t> alone;    // they match no other photograph
  std::vector<size_t> apart;    // they match others, but too few or too little
  int64_t few_features = 0;     // the number below which features are few
};

Unplaced FindUnplaced(const SfmEvidence& evidence) {
  Unplaced unplaced;
  std::vector<int64_t> sorted = evidence.num_features;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted.empty() ? 0 : static_cast<double>(sorted[sorted.size() / 2]);
  unplaced.few_features = std::max(kFewFeatures, static_cast<int64_t>(kFewOfMedian * median));
  for (const size_t i : Unregistered(evidence)) {
    if (evidence.num_features[i] < unplaced.few_features) {
      unplaced.blurred.push_back(i);
    } else if (!evidence.num_partners.empty() && evidence.num_partners[i] == 0) {
      unplaced.alone.push_back(i);
    } else {
      unplaced.apart.push_back(i);
    }
  }
  return unplaced;
}

// Returns what is wrong with the photographs without a pose, and what to do.
std::string CausesOf(const SfmEvidence& evidence) {
  const Unplaced unplaced = FindUnplaced(evidence);
  std::vector<std::string> causes;
  const auto add = [&](const std::vector<size_t>& photographs, absl::string_view one,
                       absl::string_view many, absl::string_view rest) {
    if (photographs.empty()) return;
    causes.push_back(
        absl::StrCat(Names(evidence, photographs), photographs.size() == 1 ? one : many, rest));
  };
  add(unplaced.blurred, " shows", " show",
      absl::StrCat(" fewer than ", unplaced.few_features,
                   " features: blurred, dark, or bare surfaces; take sharp ones in good light, of "
                   "things with texture"));
  if (unplaced.alone.size() == evidence.names.size()) {
    causes.push_back(
        absl::StrCat("no two photographs (", Names(evidence, unplaced.alone),
                     ") have enough in common; take more, so that neighbours have two thirds in "
                     "common"));
  } else {
    add(unplaced.alone, " has", " have",
        " nothing in common with the others: another place, or photographs in between are missing; "
        "add those, or leave it out");
  }
  add(unplaced.apart, " has", " have",
      " too little in common with the others; add photographs in between, so that neighbours have "
      "two thirds in common");
  return absl::StrJoin(causes, "; ");
}

// Returns whether the photographs match each other, but were not taken from places far enough
// apart. Without pairs of the own front: whether that is likely, as nothing else explains it.
bool LacksMotion(const SfmEvidence& evidence, size_t needed) {
  if (evidence.turns_on_the_spot) return true;
  // -1: COLMAP did not report the number, see SfmEvidence.
  const bool few_connected =
      evidence.num_connected >= 0 && static_cast<size_t>(evidence.num_connected) < needed;
  const Unplaced unplaced = FindUnplaced(evidence);
  return evidence.models.empty() && !few_connected &&
         unplaced.apart.size() > unplaced.blurred.size() + unplaced.alone.size();
}

}  // namespace

absl::Status JudgeFeatures(const SfmEvidence& evidence, const SfmOptions& options) {
  const std::vector<size_t> few = WithFewFeatures(evidence);
  const size_t num_photographs = evidence.names.size();
  const size_t needed = NumNeeded(evidence, options);
  // Judged before matching, which would take long and cannot succeed.
  if (num_photographs - few.size() >= needed) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      few.size(), " of ", num_photographs, " photographs show fewer than ", kFewFeatures,
      " features, so their poses cannot be estimated: ", Names(evidence, few),
      "; they are blurred or dark, or show bare surfaces: take at least ", needed,
      " sharp ones in good light, of things with texture, or upload poses"));
}

absl::Status JudgeModels(const SfmEvidence& evidence, const SfmOptions& options) {
  const size_t num_photographs = evidence.names.size();
  const size_t num_registered = evidence.models.empty() ? 0 : evidence.models[0].size();
  if (const std::vector<size_t> second = SecondGroup(evidence); !second.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the photographs show places that have nothing in common: ", num_registered, " of ",
        num_photographs, " show one (", Names(evidence, evidence.models[0]), "), ", second.size(),
        " another (", Names(evidence, second),
        "); make a scene of each, or add photographs that lead from one to the other"));
  }
  const size_t needed = NumNeeded(evidence, options);
  if (num_registered >= needed) return absl::OkStatus();
  const std::string cause =
      LacksMotion(evidence, needed)
          ? absl::StrCat(
                "no two photographs are from places far enough apart: the camera did not "
                "move, or only turned on the spot (",
                Names(evidence, Unregistered(evidence)),
                "); walk around the scene, a step between two photographs")
          : CausesOf(evidence);
  return absl::FailedPreconditionError(absl::StrCat("poses were found for ", num_registered, " of ",
                                                    num_photographs, " photographs, ", needed,
                                                    " are needed: ", cause, "; or upload poses"));
}

std::string DescribeUnplaced(const SfmEvidence& evidence) {
  const std::vector<size_t> unregistered = Unregistered(evidence);
  if (unregistered.empty()) return "";
  return absl::StrCat("no pose was found for ", unregistered.size(), " of ", evidence.names.size(),
                      " photographs: ", CausesOf(evidence));
}

std::string DescribeDisagreement(const SfmEvidence& evidence, int64_t agreeing, int64_t disagreeing,
                                 const std::vector<size_t>& doubtful) {
  const int64_t sum = std::max<int64_t>(agreeing + disagreeing, 1);
  const std::string which =
      doubtful.empty() ? "" : absl::StrCat(" (", Names(evidence, doubtful), ")");
  return absl::StrCat("the poses contradict ", 100 * disagreeing / sum,
                      " % of what photographs have in common, so some photographs", which,
                      " may be misplaced: the scene repeats a pattern, such as a wallpaper, or has "
                      "equal things; add photographs between those, or leave them out");
}

std::string DescribeTurn(const SfmEvidence& evidence) {
  return absl::StrCat(
      "the camera seems to have turned on the spot (",
      Names(evidence, evidence.models.empty() ? Unregistered(evidence) : evidence.models[0]),
      "), so the scene's depth may be wrong: walk around the scene, a step between "
      "two photographs");
}

}  // namespace pepeseg
