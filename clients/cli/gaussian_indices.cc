#include "clients/cli/gaussian_indices.h"

#include <iostream>
#include <iterator>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/file_bytes.h"

namespace pepeseg::client::cli {

absl::StatusOr<std::string> ReadIndices(const std::string& file) {
  if (file != "-") return ReadFile(file);
  return std::string(std::istreambuf_iterator<char>(std::cin), {});
}

absl::StatusOr<std::string> BitsOfIndices(absl::string_view text, const std::string& file,
                                          int64_t num_gaussians) {
  std::string bits(static_cast<size_t>((num_gaussians + 7) / 8), '\0');
  int64_t number = 0;
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    ++number;
    line = absl::StripAsciiWhitespace(line);
    if (line.empty()) continue;
    int64_t i = 0;
    if (!absl::SimpleAtoi(line, &i) || i < 0 || i >= num_gaussians) {
      return absl::InvalidArgumentError(absl::StrCat(
          file, ", line ", number, ": \"", line.substr(0, 40),
          "\" is not the index of a Gaussian; the model has those from 0 to ", num_gaussians - 1));
    }
    bits[i / 8] = static_cast<char>(bits[i / 8] | 1 << (i % 8));
  }
  return bits;
}

}  // namespace pepeseg::client::cli
