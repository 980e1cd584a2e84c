#include "core/sfm/colmap_progress.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/strip.h"

namespace pepeseg {
namespace {

// The numbers of a line up to its first sign that `ends` names, in order: "[3/20]" has 3 and 20.
std::vector<int64_t> NumbersBefore(absl::string_view text, char end) {
  std::vector<int64_t> numbers;
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

std::optional<int64_t> NumberAfter(absl::string_view line, absl::string_view before) {
  const size_t at = line.find(before);
  if (at == absl::string_view::npos) return std::nullopt;
  const std::vector<int64_t> numbers = NumbersBefore(line.substr(at + before.size()), ')');
  if (numbers.empty()) return std::nullopt;
  return numbers.front();
}

}  // namespace

void ColmapProgress::ReachShare(int part, int64_t done, int64_t of) {
  if (of <= 0) return;
  const int64_t within = num_photographs_ * std::clamp<int64_t>(done, 0, of) / of;
  step_ = std::max(step_, part * num_photographs_ + within);
}

void ColmapProgress::Read(absl::string_view line) {
  line = absl::StripAsciiWhitespace(line);
  if (absl::ConsumePrefix(&line, "Processed file [")) {
    const std::vector<int64_t> counts = NumbersBefore(line, ']');
    if (counts.size() == 2) ReachShare(0, counts[0], counts[1]);
  } else if (absl::ConsumePrefix(&line, "Name:")) {
    name_ = std::string(absl::StripAsciiWhitespace(line));
  } else if (absl::ConsumePrefix(&line, "Features:")) {
    const std::vector<int64_t> count = NumbersBefore(line, '\n');
    if (!count.empty() && !name_.empty()) num_features_[name_] = count.front();
  } else if (absl::ConsumePrefix(&line, "Matching image [")) {
    const std::vector<int64_t> counts = NumbersBefore(line, ']');
    if (counts.size() == 2) ReachShare(1, counts[0], counts[1]);
  } else if (absl::ConsumePrefix(&line, "Matching block [")) {
    // Of a square of blocks, row by row.
    const std::vector<int64_t> counts = NumbersBefore(line, ']');
    if (counts.size() == 4) {
      ReachShare(1, (counts[0] - 1) * counts[3] + counts[2], counts[1] * counts[3]);
    }
  } else if (absl::StartsWith(line, "Loading images...")) {
    num_connected_ = NumberAfter(line, "(connected").value_or(num_connected_);
  } else if (absl::StartsWith(line, "Registering image #")) {
    // In brackets stands the number that it would have.
    const std::optional<int64_t> number = NumberAfter(line, "(");
    if (number) ReachShare(2, *number - 1, num_photographs_);
  }
}

}  // namespace pepeseg
