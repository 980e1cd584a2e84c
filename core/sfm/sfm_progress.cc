#include "core/sfm/sfm_progress.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/strip.h"

namespace pepeseg {
namespace {

// Returns the numbers of a text in front of the first `end`, in order: 3 and 20 for "3/20] x" and
// ']'.
std::vector<int64_t> NumbersBefore(absl::string_view text, char end) {
  std::vector<int64_t> numbers;
  // A number that does not fit into 64 bits is left out: the output of a program is not trusted.
  for (size_t at = 0; at < text.size() && text[at] != end;) {
    size_t length = 0;
    while (at + length < text.size() &&
           absl::ascii_isdigit(static_cast<unsigned char>(text[at + length]))) {
      ++length;
    }
    int64_t number = 0;
    if (length > 0 && absl::SimpleAtoi(text.substr(at, length), &number)) numbers.push_back(number);
    at += std::max<size_t>(length, 1);
  }
  return numbers;
}

// Returns the first number after the text `before`, if it is followed by one.
std::optional<int64_t> NumberAfter(absl::string_view line, absl::string_view before) {
  const size_t at = line.find(before);
  if (at == absl::string_view::npos) return std::nullopt;
  const std::vector<int64_t> numbers = NumbersBefore(line.substr(at + before.size()), ')');
  if (numbers.empty()) return std::nullopt;
  return numbers.front();
}

}  // namespace

std::string_view SfmProgress::activity() const {
  switch (part_) {
    case kExtracting:
      return "finding features in";
    case kChoosing:
      return "choosing among";
    case kMatching:
      return "matching";
    case kMapping:
      return "placing";
    default:
      return "";
  }
}

std::string_view SfmProgress::unit() const {
  if (part_ == kNone) return "";
  return part_ == kChoosing || (part_ == kMatching && by_pairs_) ? "pairs" : "photographs";
}

int64_t SfmProgress::NumSteps(Part part, int64_t of) const {
  if (part == kChoosing) return of;
  return part == kMatching && by_pairs_ ? num_pairs_ : num_photographs_;
}

void SfmProgress::Reach(Part part, int64_t done, int64_t of) {
  // Numbers of COLMAP may restart (a second model of the mapper), so steps are kept from falling.
  if (of <= 0 || part < part_) return;
  if (part > part_) step_ = 0;
  part_ = part;
  done = std::clamp<int64_t>(done, 0, of);
  num_steps_ = NumSteps(part, of);
  step_ = std::max(step_, num_steps_ * done / of);
  const double parts[] = {work_.extracting, work_.choosing, work_.matching, work_.mapping};
  double work = parts[part] * static_cast<double>(done) / static_cast<double>(of);
  for (int before = 0; before < part; ++before) work += parts[before];
  if (work_.sum() > 0) share_ = std::max(share_, work / work_.sum());
  if (part == kMapping && done == of) share_ = 1;  // whatever the sum rounds to
}

void SfmProgress::Extract(const std::string& name, int64_t num_features) {
  num_features_[name] = num_features;
  Reach(kExtracting, static_cast<int64_t>(num_features_.size()), num_photographs_);
}

void SfmProgress::Compare(int64_t done, int64_t total) {
  by_pairs_ |= part_ <= kMatching;
  num_pairs_ = total;  // it may find more pairs to compare
  Reach(kMatching, done, total);
}

void SfmProgress::Place(double share) {
  // Only Finish completes the part: COLMAP may still have to place the photographs.
  constexpr int64_t kSteps = 1000;
  Reach(kMapping, std::min(kSteps - 1, static_cast<int64_t>(share * kSteps)), kSteps);
}

void SfmProgress::Finish() { Reach(kMapping, 1, 1); }

// Reads "[5/20]", a count of photographs, or "[1/4, 3/4]", a position in the square of blocks,
// which COLMAP compares row by row.
void SfmProgress::ReadMatching(absl::string_view counts) {
  const std::vector<int64_t> numbers = NumbersBefore(counts, ']');
  if (numbers.size() == 2) Reach(kMatching, numbers[0], numbers[1]);
  // by_pairs_ changes the unit, so a stray line of a later part must not set it.
  if (numbers.size() != 4 || part_ > kMatching) return;
  by_pairs_ = true;
  Reach(kMatching, (numbers[0] - 1) * numbers[3] + numbers[2], numbers[1] * numbers[3]);
}

void SfmProgress::Read(absl::string_view line) {
  line = absl::StripAsciiWhitespace(line);
  if (absl::ConsumePrefix(&line, "Processed file [")) {
    const std::vector<int64_t> counts = NumbersBefore(line, ']');
    if (counts.size() == 2) Reach(kExtracting, counts[0], counts[1]);
  } else if (absl::ConsumePrefix(&line, "Name:")) {
    name_ = std::string(absl::StripAsciiWhitespace(line));
  } else if (absl::ConsumePrefix(&line, "Features:")) {
    const std::vector<int64_t> count = NumbersBefore(line, '\n');
    if (!count.empty() && !name_.empty()) num_features_[name_] = count.front();
  } else if (absl::ConsumePrefix(&line, "Matching image [") ||
             absl::ConsumePrefix(&line, "Matching block [")) {
    ReadMatching(line);
  } else if (absl::StartsWith(line, "Loading images...")) {
    num_connected_ = NumberAfter(line, "(connected").value_or(num_connected_);
  } else if (absl::StartsWith(line, "Registering image #")) {
    // The number in brackets counts the photograph that is about to be registered.
    const std::optional<int64_t> number = NumberAfter(line, "(");
    if (number) Reach(kMapping, *number - 1, num_photographs_);
  }
}

}  // namespace pepeseg
