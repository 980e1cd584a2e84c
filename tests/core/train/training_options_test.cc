#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "core/train/settings/training_settings.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Calls `check` with each option of the default settings that is a number with a range: a function
// that sets it to a value and validates all settings, the range, and the step from one value of its
// type to the next.
void ForEachRange(absl::FunctionRef<void(const std::string& name, const Range& range, bool whole,
                                         absl::FunctionRef<absl::Status(double)> validate)>
                      check) {
  TrainingSettings settings;
  settings.features.num_drawn_neighbors = 1;  // at most num_neighbors
  VisitOptions(settings, [&](const Option& option) {
    std::visit(
        [&](const auto& field) {
          using Field = std::decay_t<decltype(field)>;
          if constexpr (std::is_pointer_v<Field>) {
            using Value = std::remove_pointer_t<Field>;
            if constexpr (!std::is_same_v<Value, bool> && !std::is_same_v<Value, uint64_t>) {
              const auto before = *field;
              check(option.name, option.range, std::is_integral_v<Value>, [&](double value) {
                *field = static_cast<Value>(value);
                return Validate(settings);
              });
              *field = before;
            }
          }
        },
        option.field);
  });
}

TEST(TrainingOptions, AreValidAtBothBoundsAndRefusedBeyondThem) {
  int num_ranges = 0;
  ForEachRange([&](const std::string& name, const Range& range, bool whole,
                   absl::FunctionRef<absl::Status(double)> validate) {
    ++num_ranges;
    ASSERT_TRUE(std::isfinite(range.low) && std::isfinite(range.high)) << name << " has no range";
    // num_drawn_neighbors is also limited by another option.
    const double high = name == "features.num_drawn_neighbors" ? 4 : range.high;
    if (!range.open) {
      EXPECT_OK(validate(range.low)) << name;
    }
    EXPECT_OK(validate(high)) << name;
    if (range.also) {
      EXPECT_OK(validate(*range.also)) << name;
    }
    const double below = whole ? range.low - 1 : range.low - 0.01 * (1 + std::abs(range.low));
    if (!range.also || below != *range.also) {
      EXPECT_STATUS(validate(range.open ? range.low : below), absl::StatusCode::kInvalidArgument,
                    name + " is ");
    }
    if (high < std::numeric_limits<int>::max()) {
      const double above = whole ? high + 1 : high * 1.01;
      EXPECT_STATUS(validate(above), absl::StatusCode::kInvalidArgument, name + " is ");
    }
    if (!whole) {
      EXPECT_STATUS(validate(NAN), absl::StatusCode::kInvalidArgument, name + " is nan");
    }
  });
  EXPECT_GT(num_ranges, 60);
}

TEST(TrainingOptions, AreSetToEachOfTheirWordsByName) {
  TrainingSettings settings;
  VisitOptions(settings, [](const Option& option) {
    const auto* field = std::get_if<WordField>(&option.field);
    if (field == nullptr) return;
    std::set<int> values;
    for (const auto& word : field->words) {
      EXPECT_OK(SetOption(option, word.first)) << option.name;
      EXPECT_EQ(TextOf(option).value, word.first) << option.name;
      values.insert(word.second);
    }
    EXPECT_EQ(values.size(), field->words.size()) << option.name << " has two words of one value";
    field->set(field->field, 99);
    EXPECT_STATUS(CheckOption(option), absl::StatusCode::kInvalidArgument, option.name + " is 99");
  });
}

// The descriptions are read from the structs: a member without a row has one, too.
TEST(TrainingOptions, HaveARowForEachMemberOfTheirStructs) {
  std::vector<std::string> names, described;
  for (const OptionText& option : ListOptions(TrainingSettings())) {
    names.push_back(option.name);
    EXPECT_FALSE(option.range.empty()) << option.name;
  }
  for (const auto& description : OptionDescriptions()) {
    described.emplace_back(description.first);
    EXPECT_FALSE(description.second.empty()) << description.first;
  }
  EXPECT_THAT(names, ::testing::UnorderedElementsAreArray(described));
  EXPECT_EQ(OptionDescriptions().at("features.seed"), "Seed of all random draws of the stage.");
}

TEST(TrainingOptions, ChecksOneOptionAgainstAnother) {
  TrainingSettings settings;
  settings.features.num_drawn_neighbors = 5;
  EXPECT_STATUS(Validate(settings), absl::StatusCode::kInvalidArgument,
                "features.num_drawn_neighbors is 5, must be in [1, 4]");
}

}  // namespace
}  // namespace pepeseg
