#include "core/base/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Colour { kRed = 1, kGreen = 2, kDarkBlue = 3 };

// A struct of options as CONTRIBUTING.md has it: a member and a row for each.
struct DummyOptions {
  bool on = true;
  int count = 3;
  int64_t bytes = 5;
  uint64_t seed = 1;
  float rate = 0.9f;
  double share = 0.5;
  double weight = -1;
  Colour colour = Colour::kGreen;
  std::vector<std::string> views = {};
};
void VisitOptions(DummyOptions& o, OptionVisitor visit) {
  visit({"on", &o.on});
  visit({"count", &o.count, Range{1, 10'000'000}});
  visit({"bytes", &o.bytes, Range{.low = 2, .high = 1e9, .also = 0}});
  visit({"seed", &o.seed});
  visit({"rate", &o.rate, Range{1e-12, 0.9}});
  visit({"share", &o.share, Range{.low = 0, .high = 1, .open = true}});
  visit({"weight", &o.weight, Range{.low = 0, .high = 10, .also = -1}});
  visit({"colour", WordsOf<Colour>(&o.colour, {{"red", Colour::kRed},
                                               {"green", Colour::kGreen},
                                               {"dark_blue", Colour::kDarkBlue}})});
  visit({"views", NamesField{&o.views, 2}});
}

// Expects that the option is refused at this value, with this message.
void ExpectRefused(const DummyOptions& options, const std::string& message) {
  const absl::Status status = CheckOptions(options);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_EQ(status.message(), message);
}

TEST(CheckOptions, NamesTheOptionItsValueAndItsRange) {
  EXPECT_OK(CheckOptions(DummyOptions()));
  ExpectRefused({.count = 0}, "count is 0, must be in [1, 10000000]");
  ExpectRefused({.bytes = 1}, "bytes is 1, must be 0 or in [2, 1000000000]");
  ExpectRefused({.rate = NAN}, "rate is nan, must be in [1e-12, 0.9]");
  ExpectRefused({.share = 0}, "share is 0, must be in (0, 1]");
  ExpectRefused({.weight = -0.5}, "weight is -0.5, must be -1 or in [0, 10]");
  ExpectRefused({.colour = Colour{7}}, "colour is 7, must be red, green or dark_blue");
  ExpectRefused({.views = {"a", "b", "c"}}, "views has 3 names, the limit is 2");
}

TEST(CheckOptions, TakesTheBoundsOfARange) {
  EXPECT_OK(CheckOptions(DummyOptions{.count = 1, .rate = 1e-12f, .share = 1, .weight = 10}));
  EXPECT_OK(CheckOptions(DummyOptions{.count = 10'000'000, .bytes = 0, .rate = 0.9f}));
}

TEST(ListOptions, HasTheNameValueAndRangeOfEachRow) {
  std::vector<std::string> lines;
  for (const OptionText& option : ListOptions(DummyOptions{.views = {"a", "b"}})) {
    lines.push_back(absl::StrCat(option.name, "=", option.value, " ", option.range));
  }
  EXPECT_THAT(lines,
              ElementsAre("on=true true or false", "count=3 [1, 10000000]",
                          "bytes=5 0 or [2, 1000000000]", "seed=1 [0, 18446744073709551615]",
                          "rate=0.9 [1e-12, 0.9]", "share=0.5 (0, 1]", "weight=-1 -1 or [0, 10]",
                          "colour=green red, green or dark_blue", "views=a,b names, at most 2"));
}

TEST(SetByName, SetsAMemberOfEachType) {
  DummyOptions options;
  for (const auto& [name, text] : {std::pair("on", "false"),
                                   {"count", "7"},
                                   {"bytes", "0"},
                                   {"seed", "18446744073709551615"},
                                   {"rate", "1e-3"},
                                   {"share", "0.25"},
                                   {"weight", "2"},
                                   {"colour", "dark_blue"},
                                   {"views", "a b.jpg"}}) {
    EXPECT_OK(SetByName(options, name, text)) << name;
  }
  EXPECT_FALSE(options.on);
  EXPECT_EQ(options.count, 7);
  EXPECT_EQ(options.bytes, 0);
  EXPECT_EQ(options.seed, ~uint64_t{0});
  EXPECT_EQ(options.rate, 1e-3f);
  EXPECT_EQ(options.share, 0.25);
  EXPECT_EQ(options.weight, 2);
  EXPECT_EQ(options.colour, Colour::kDarkBlue);
  EXPECT_THAT(options.views, ElementsAre("a b.jpg"));
}

TEST(SetByName, ReadsWhatTheListWrites) {
  const DummyOptions options = {
      .on = false, .count = 9, .rate = 0.1f, .share = 1.0 / 3, .colour = Colour::kRed};
  DummyOptions copy;
  for (const OptionText& option : ListOptions(options)) {
    if (option.value.empty()) continue;  // an empty list
    EXPECT_OK(SetByName(copy, option.name, option.value)) << option.name;
  }
  EXPECT_EQ(copy.rate, options.rate);
  EXPECT_EQ(copy.share, options.share);
  EXPECT_EQ(copy.colour, options.colour);
  EXPECT_EQ(copy.on, options.on);
}

TEST(SetByName, LeavesTheOptionWhenItRefusesTheText) {
  DummyOptions options;
  for (const auto& [name, text] : {std::pair("count", "many"),
                                   {"count", "1.5"},
                                   {"count", "99999999999"},
                                   {"count", ""},
                                   {"seed", "-1"},
                                   {"on", "perhaps"},
                                   {"rate", "1"},
                                   {"weight", "nan"},
                                   {"colour", "blue"},
                                   {"views", ""}}) {
    EXPECT_STATUS(SetByName(options, name, text), absl::StatusCode::kInvalidArgument, name);
  }
  EXPECT_OK(CheckOptions(options));
  EXPECT_EQ(options.count, 3);
  EXPECT_EQ(options.rate, 0.9f);
  EXPECT_EQ(SetByName(options, "count", "0").message(), "count is \"0\", must be in [1, 10000000]");
  EXPECT_EQ(SetByName(options, "colour", "blue").message(),
            "colour is \"blue\", must be red, green or dark_blue");
}

TEST(SetByName, SaysWhichTypeOfNumberItTakes) {
  DummyOptions options;
  const auto message = [&](const char* name, const char* text) {
    return std::string(SetByName(options, name, text).message());
  };
  EXPECT_EQ(message("count", "1.5"), "count is \"1.5\", must be a whole number in [1, 10000000]");
  EXPECT_EQ(message("count", "1e4"), "count is \"1e4\", must be a whole number in [1, 10000000]");
  EXPECT_EQ(message("share", "0,5"), "share is \"0,5\", must be a number in (0, 1]");
  EXPECT_EQ(message("weight", ""), "weight is \"\", must be -1 or a number in [0, 10]");
  EXPECT_EQ(message("weight", "11"), "weight is \"11\", must be -1 or in [0, 10]");
  EXPECT_EQ(message("on", "2"), "on is \"2\", must be true or false");
}

TEST(SetByName, LimitsTheNamesOfAList) {
  DummyOptions options = {.views = {"a", "b"}};
  EXPECT_EQ(SetByName(options, "views", "c").message(), "views has more than 2 names");
  EXPECT_EQ(SetByName(options, "views", "").message(), "views has an empty name");
  EXPECT_THAT(options.views, ElementsAre("a", "b"));
}

// A megabyte of name or value takes no time and ends in a short message of whole characters.
TEST(SetByName, CutsLongTextInMessages) {
  DummyOptions options;
  std::string text = "x";
  for (int i = 0; i < 500'000; ++i) text += "ä";
  const std::string cut = "x" + text.substr(1, 98) + "...\"";
  EXPECT_EQ(SetByName(options, text, "1").message(), "unknown option \"" + cut);
  EXPECT_EQ(SetByName(options, "colour", text).message(),
            "colour is \"" + cut + ", must be red, green or dark_blue");
}

TEST(SetByName, ProposesTheNearestNames) {
  DummyOptions options;
  const auto message = [&](const char* name) {
    return std::string(SetByName(options, name, "1").message());
  };
  EXPECT_EQ(message("coun"), "unknown option \"coun\"; did you mean count?");
  EXPECT_EQ(message("sed"), "unknown option \"sed\"; did you mean seed?");
  EXPECT_EQ(message("zzzzz"), "unknown option \"zzzzz\"");
  EXPECT_EQ(message(""), "unknown option \"\"");
}

struct Whole {
  DummyOptions first, second;
};
void VisitOptions(Whole& whole, OptionVisitor visit) {
  VisitPart("first", whole.first, visit);
  VisitPart("second", whole.second, visit);
}

TEST(VisitPart, PutsThePartsNameBeforeItsOptions) {
  Whole whole;
  EXPECT_OK(SetByName(whole, "second.count", "8"));
  EXPECT_EQ(whole.first.count, 3);
  EXPECT_EQ(whole.second.count, 8);
  whole.second.count = 0;
  EXPECT_STATUS(CheckOptions(whole), absl::StatusCode::kInvalidArgument, "second.count is 0");
  EXPECT_THAT(std::string(SetByName(whole, "third.share", "1").message()),
              HasSubstr("did you mean first.share or second.share?"));
  // The part's name does not let more errors pass: first.rate is three letters away.
  EXPECT_EQ(SetByName(whole, "first.shre", "1").message(),
            "unknown option \"first.shre\"; did you mean first.share?");
}

}  // namespace
}  // namespace pepeseg
