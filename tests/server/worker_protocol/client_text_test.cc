#include "server/worker_protocol/client_text.h"

#include <gtest/gtest.h>

#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {
namespace {

TEST(ClientText, LeavesPlainTextAsItIs) {
  for (const char* text : {"", "images/ä b.jpg: truncated", "19 of 60 pairs, 3 / 4, and/or",
                           "see https://example.org/a/b?c", "日本語", "no files in / or /tmp"}) {
    EXPECT_EQ(ClientText(text), text);
  }
}

TEST(ClientText, CutsAbsolutePathsToTheirLastPart) {
  EXPECT_EQ(ClientText("/srv/data/jobs/j1/work/attempt-1/model.json: open: denied"),
            "model.json: open: denied");
  EXPECT_EQ(ClientText("File \"/opt/x/site-packages/run.py\", line 3"), "File \"run.py\", line 3");
  EXPECT_EQ(ClientText("cannot read '/srv/a/b' (/srv/c/d), x=/srv/e/f/"),
            "cannot read 'b' (d), x=f");
  EXPECT_EQ(ClientText("images/a.jpg\n/srv/data/x"), "images/a.jpg | x");
}

TEST(ClientText, IsOnePrintableLine) {
  EXPECT_EQ(ClientText("one\r\ntwo\tthree\n"), "one | two three");
  EXPECT_EQ(ClientText("\x1b[31mred\x07"), "?[31mred?");
  EXPECT_EQ(ClientText("a\xc2\x9b"
                       "b\xe2\x80\xae"
                       "c\xe2\x80\xa8"
                       "d\xff"
                       "e"),
            "a?b?c?d?e");
  EXPECT_EQ(ClientText(std::string("a\0b", 3)), "a?b");
}

TEST(ClientText, IsBounded) {
  const std::string text = ClientText(std::string(1 << 20, 'x'));
  EXPECT_EQ(text.size(), kMaxClientText);
  EXPECT_TRUE(text.ends_with("x..."));
  std::string umlauts;
  for (int i = 0; i < 100; ++i) umlauts += "ä";
  EXPECT_EQ(ClientText(umlauts, 10), "äää...");
}

TEST(ClientText, CleansNestedMessages) {
  v1::JobEvent event;
  event.mutable_stage_ended()->set_skipped("not in /srv/data/x");
  event.mutable_stage_ended()->add_views()->set_view("a\x1b");
  (*event.mutable_stage_ended()->mutable_metrics())["psnr"] = 3;
  CleanTexts(event);
  EXPECT_EQ(event.stage_ended().skipped(), "not in x");
  EXPECT_EQ(event.stage_ended().views(0).view(), "a?");
  EXPECT_EQ(event.stage_ended().metrics().at("psnr"), 3);
}

}  // namespace
}  // namespace pepeseg
