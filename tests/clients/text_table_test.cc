#include "clients/cli/text_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cli/next_command.h"

namespace pepeseg::client::cli {
namespace {

TEST(TextTable, AlignsColumnsBelowAHeader) {
  EXPECT_THAT(
      TextTable({{"SCENE", "AGE", "STATE"}, {"a", "12 days", ""}, {"shelf", "3 s", "ok"}}),
      ::testing::ElementsAre("SCENE  AGE      STATE", "a      12 days", "shelf  3 s      ok"));
}

TEST(SpanText, KeepsTheLargestUnit) {
  EXPECT_EQ(SpanText(absl::Seconds(-5)), "0 s");
  EXPECT_EQ(SpanText(absl::Seconds(59)), "59 s");
  EXPECT_EQ(SpanText(absl::Seconds(3599)), "59 min");
  EXPECT_EQ(SpanText(absl::Hours(47)), "47 h");
  EXPECT_EQ(SpanText(absl::Hours(24 * 12)), "12 days");
}

TEST(SizeText, ChoosesTheUnit) {
  EXPECT_EQ(SizeText(0), "0 kB");
  EXPECT_EQ(SizeText(840'000), "840 kB");
  EXPECT_EQ(SizeText(12'300'000), "12.3 MB");
  EXPECT_EQ(SizeText(1'200'000'000), "1.2 GB");
}

v1::View ViewOf(const std::string& name, bool held_out) {
  v1::View view;
  view.set_view(name);
  view.set_held_out(held_out);
  view.mutable_camera()->set_width(320);
  view.mutable_camera()->set_height(240);
  return view;
}

TEST(FirstQuestion, ClicksInTheMiddleOfAViewOfTheScene) {
  Shell shell;
  v1::Model model;
  model.set_name("scenes/shelf/models/2");
  std::vector<v1::View> views = {ViewOf("a.jpg", true), ViewOf("b c.jpg", false)};
  EXPECT_EQ(FirstQuestion(shell, model, views),
            "pepeseg segment shelf --view 'b c.jpg' --point 160,120 --views all --out masks");
  views[1].set_photograph_width(640);
  views[1].set_photograph_height(480);
  EXPECT_THAT(FirstQuestion(shell, model, views), ::testing::HasSubstr("--point 320,240 "))
      << "pixels are the photograph's";
  (*model.mutable_sources())["masks"] = "none";
  EXPECT_EQ(FirstQuestion(shell, model, views), "pepeseg export shelf shelf.ply");
}

TEST(CommandText, IsAsTheProgramWasCalled) {
  Shell shell;
  shell.program = "build/bin/pepeseg";
  shell.server = "127.0.0.1:7";
  EXPECT_EQ(CommandText(shell, {"train", "it's"}),
            "build/bin/pepeseg train 'it'\\''s' --server 127.0.0.1:7");
}

}  // namespace
}  // namespace pepeseg::client::cli
