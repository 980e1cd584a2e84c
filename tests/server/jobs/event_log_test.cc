#include "server/jobs/event_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "server/jobs/crc32c.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

v1::JobEvent Warning(const std::string& message) {
  v1::JobEvent event;
  event.mutable_warning()->set_message(message);
  return event;
}

class EventLogTest : public ::testing::Test {
 protected:
  EventLogTest() : path_(folder_.path() / "events.log") {}

  void Append(const std::vector<std::string>& messages) {
    auto writer = EventLogWriter::Open(path_);
    ASSERT_TRUE(writer.ok()) << writer.status();
    for (const std::string& message : messages) {
      ASSERT_TRUE((*writer)->Append(Warning(message)).ok());
    }
  }

  // "1:first" and so on.
  static std::vector<std::string> Told(const std::vector<v1::JobEvent>& events) {
    std::vector<std::string> told;
    told.reserve(events.size());
    for (const v1::JobEvent& event : events) {
      told.push_back(std::to_string(event.sequence()) + ":" + event.warning().message());
    }
    return told;
  }

  std::vector<std::string> ReadAll(int64_t after = 0) {
    EventLogReader reader(path_, after);
    const auto events = reader.Read();
    EXPECT_TRUE(events.ok()) << events.status();
    return Told(*events);
  }

  void Flip(int64_t offset) {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(offset);
    const auto byte = static_cast<char>(file.get() ^ 0x10);
    file.seekp(offset);
    file.put(byte);
  }

  testing::TempFolder folder_;
  std::filesystem::path path_;
};

using ::testing::ElementsAre;

TEST(Crc32c, MatchesThePublishedCheckValues) {
  EXPECT_EQ(Crc32c("123456789"), 0xe3069283u);            // the catalogue's check value
  EXPECT_EQ(Crc32c(std::string(32, '\0')), 0x8a9136aau);  // RFC 3720, B.4
  EXPECT_EQ(Crc32c(std::string(32, '\xff')), 0x62a8ab43u);
  EXPECT_EQ(Crc32c(std::string("6789"), Crc32c("12345")), 0xe3069283u);
}

TEST_F(EventLogTest, NumbersEventsAcrossWriters) {
  Append({"a", "b"});
  Append({"c"});
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b", "3:c"));
  EXPECT_THAT(ReadAll(/*after=*/2), ElementsAre("3:c"));
}

TEST_F(EventLogTest, GivesEventsTheirTime) {
  Append({"a"});
  EventLogReader reader(path_);
  EXPECT_NEAR(reader.Read()->at(0).time().seconds(), time(nullptr), 60);
}

TEST_F(EventLogTest, ReaderFollowsTheWriter) {
  EventLogReader reader(path_);
  EXPECT_TRUE(reader.Read()->empty());  // not there yet
  auto writer = EventLogWriter::Open(path_);
  ASSERT_TRUE((*writer)->Append(Warning("a")).ok());
  EXPECT_THAT(Told(*reader.Read()), ElementsAre("1:a"));
  EXPECT_TRUE(reader.Read()->empty());
  ASSERT_TRUE((*writer)->Append(Warning("b")).ok());
  ASSERT_TRUE((*writer)->Append(Warning("c")).ok());
  EXPECT_THAT(Told(*reader.Read(1)), ElementsAre("2:b"));
  EXPECT_THAT(Told(*reader.Read(1)), ElementsAre("3:c"));
}

TEST_F(EventLogTest, TornTailIsNotThereYetAndIsCutByTheNextWriter) {
  Append({"a", "b"});
  const auto whole = std::filesystem::file_size(path_);
  Append({"torn"});
  // Every cut through the last record: within its header, its payload, and before its last byte.
  for (auto size = std::filesystem::file_size(path_) - 1; size > whole; --size) {
    std::filesystem::resize_file(path_, size);
    EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b")) << size;
  }
  Append({"c"});
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b", "3:c"));
}

TEST_F(EventLogTest, FlippedByteIsToldAfterWhatIsBeforeIt) {
  Append({"a"});
  const auto first = static_cast<int64_t>(std::filesystem::file_size(path_));
  Append({"b", "c"});
  Flip(first + 10);
  EventLogReader reader(path_);
  EXPECT_THAT(Told(*reader.Read()), ElementsAre("1:a"));
  const auto broken = reader.Read().status();
  EXPECT_EQ(broken.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(broken.message()), ::testing::HasSubstr(path_.string()));
  Append({"d"});
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:d"));
}

TEST_F(EventLogTest, AbsurdLengthAllocatesNothing) {
  Append({"a"});
  Flip(3);  // the highest byte of the length: 256 MiB
  EventLogReader reader(path_);
  EXPECT_EQ(reader.Read().status().code(), absl::StatusCode::kDataLoss);
}

// Attempts: each goes on where the one before it was when it took over.
class AttemptLogTest : public EventLogTest {
 protected:
  std::unique_ptr<EventLogWriter> Open(int64_t fence) {
    auto writer = EventLogWriter::Open(path_, fence);
    EXPECT_TRUE(writer.ok()) << writer.status();
    return std::move(writer).value();
  }
};

TEST_F(AttemptLogTest, NumbersGoOnFromAttemptToAttempt) {
  Append({"queued"});
  ASSERT_TRUE(Open(1)->Append(Warning("first")).ok());
  ASSERT_TRUE(Open(3)->Append(Warning("third")).ok());  // the second never wrote
  ASSERT_TRUE(Open(3)->Append(Warning("third again")).ok());
  EXPECT_THAT(ReadAll(), ElementsAre("1:queued", "2:first", "3:third", "4:third again"));
  EXPECT_THAT(ReadAll(2), ElementsAre("3:third", "4:third again"));
}

TEST_F(AttemptLogTest, WhatAnAttemptWritesAfterItLostItsClaimIsReadByNobody) {
  const auto stale = Open(1);
  ASSERT_TRUE(stale->Append(Warning("mine")).ok());
  const auto next = Open(2);
  ASSERT_TRUE(stale->Append(Warning("stale")).ok());
  ASSERT_TRUE(next->Append(Warning("next")).ok());
  ASSERT_TRUE(stale->Append(Warning("stale, too")).ok());
  EXPECT_THAT(ReadAll(), ElementsAre("1:mine", "2:next"));
  EXPECT_EQ(Open(2)->last_sequence(), 2);
  EXPECT_EQ(Open(3)->last_sequence(), 2);
}

TEST_F(AttemptLogTest, ReaderGoesOnToTheNextAttempt) {
  EventLogReader reader(path_);
  ASSERT_TRUE(Open(1)->Append(Warning("a")).ok());
  EXPECT_THAT(Told(*reader.Read()), ElementsAre("1:a"));
  EXPECT_TRUE(reader.Read()->empty());
  ASSERT_TRUE(Open(2)->Append(Warning("b")).ok());
  EXPECT_THAT(Told(*reader.Read()), ElementsAre("2:b"));
  EXPECT_EQ(reader.fence(), 2);
}

TEST_F(AttemptLogTest, BrokenRecordEndsAnAttemptOnly) {
  Append({"a", "b"});
  Flip(static_cast<int64_t>(std::filesystem::file_size(path_)) - 1);
  EventLogReader alone(path_);
  EXPECT_THAT(Told(*alone.Read()), ElementsAre("1:a"));
  EXPECT_EQ(alone.Read().status().code(), absl::StatusCode::kDataLoss);
  ASSERT_TRUE(Open(1)->Append(Warning("c")).ok());
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:c"));
}

// A folder stands in for a file on a bad disk: it opens, and its bytes cannot be had.
TEST_F(AttemptLogTest, WhatCannotBeReadIsNeitherPassedNorCut) {
  Append({"a"});
  const std::filesystem::path bad = folder_.path() / "events-1.log";
  std::filesystem::create_directory(bad);
  EventLogReader reader(path_);
  EXPECT_EQ(reader.Read().status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(EventLogWriter::Open(path_, 2).status().code(), absl::StatusCode::kInternal);
  std::filesystem::remove(bad);
  EXPECT_THAT(ReadAll(), ElementsAre("1:a"));
  ASSERT_TRUE(Open(2)->Append(Warning("b")).ok());
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b"));
}

// A machine that died while a file was begun.
TEST_F(AttemptLogTest, FileWithoutItsFirstRecordIsNotThere) {
  Append({"a"});
  std::ofstream(folder_.path() / "events-1.log") << "torn";
  EXPECT_THAT(ReadAll(), ElementsAre("1:a"));
  ASSERT_TRUE(Open(1)->Append(Warning("b")).ok());
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b"));
}

}  // namespace
}  // namespace pepeseg
