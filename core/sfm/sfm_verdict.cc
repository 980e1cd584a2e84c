#include "core/sfm/sfm_verdict.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// A photograph with fewer features shows too little. Sharp ones have thousands, unless they show a
// bare wall; 15 matches suffice to connect two photographs.
constexpr int64_t kFewFeatures = 100;
constexpr size_t kLeastRegistered = 3;
// A second model with at least this share of the photographs is a second place.
constexpr double kLargeGroup = 0.25;
constexpr size_t kNamed = 5;  // names in a message, at most

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

// Returns the likely cause of too few poses, and what to do about it. Checked in this order: too
// few features, no baseline between photographs that match, too little overlap.
std::string Advice(const SfmEvidence& evidence, size_t needed) {
  const std::vector<size_t> few = WithFewFeatures(evidence);
  // Few features explain the failure if they account for half of what is missing.
  if (!few.empty() && 2 * few.size() >= Unregistered(evidence).size()) {
    return absl::StrCat(
        few.size(), " of the photographs show too little: blurred, dark, or bare surfaces (",
        Names(evidence, few), "); take sharp ones in good light, of things with texture");
  }
  // -1: COLMAP did not report the number, see SfmEvidence.
  const bool few_connected =
      evidence.num_connected >= 0 && static_cast<size_t>(evidence.num_connected) < needed;
  if (evidence.models.empty() && !few_connected) {
    return "they match each other, but no two of them are from places far enough apart: the camera "
           "did not move, or only turned; walk around the scene, a step between two photographs";
  }
  return "too little of what one photograph shows is in the next; take more of them, so that "
         "neighbours have two thirds in common, and upload no others among them";
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
  return absl::FailedPreconditionError(absl::StrCat(
      "poses were found for ", num_registered, " of ", num_photographs, " photographs, ", needed,
      " are needed; not for ", Names(evidence, Unregistered(evidence)), ": ",
      Advice(evidence, needed), "; or upload poses"));
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

}  // namespace pepeseg
