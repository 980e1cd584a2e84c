#include "clients/cli/subset.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"

namespace pepeseg::client::cli {

void AddScalesFlag(CLI::App& verb, std::vector<double>& scales) {
  verb.add_option("--scales", scales,
                  "Quantile scales of the levels, ascending, with commas: 0.01,0.5,1 by default")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(0.0, 1.0));
}

void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags) {
  CLI::Option* selection =
      verb.add_option("--selection", flags.selection, "Number of a selection: only its Gaussians")
          ->check(CLI::PositiveNumber);
  verb.add_option("--segment", flags.segment,
                  "LEVEL:ID, as `pepeseg decompose` tells them: only its Gaussians")
      ->excludes(selection);
  AddScalesFlag(verb, flags.scales);
  verb.add_flag("--without", flags.without, "All others in their place");
}

absl::StatusOr<v1::Subset> ParseSubset(const SubsetFlags& flags, const std::string& scene) {
  v1::Subset subset;
  subset.set_complement(flags.without);
  if (flags.selection != 0) {
    subset.set_selection(absl::StrCat(SceneName(scene), "/selections/", flags.selection));
  } else if (!flags.segment.empty()) {
    const std::vector<std::string> parts = absl::StrSplit(flags.segment, ':');
    int level = 0, id = 0;
    if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &level) ||
        !absl::SimpleAtoi(parts[1], &id) || level < 0 || id < 1) {
      return absl::InvalidArgumentError(
          absl::StrCat("--segment ", flags.segment, ": no LEVEL:ID, as in 1:3"));
    }
    subset.mutable_segment()->set_level(level);
    subset.mutable_segment()->set_id(id);
    subset.mutable_segment()->mutable_scales()->Add(flags.scales.begin(), flags.scales.end());
  } else if (flags.without) {
    return absl::InvalidArgumentError("--without what? It needs --selection or --segment");
  }
  return subset;
}

}  // namespace pepeseg::client::cli
