#include "server/worker_protocol/event_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "core/base/digest.h"
#include "tests/testing/status_testing.h"
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
    ASSERT_OK_AND_ASSIGN(auto writer, EventLogWriter::Open(path_));
    for (const std::string& message : messages) {
      ASSERT_OK(writer->Append(Warning(message)));
    }
  }

  // Returns the events as "1:first" and so on.
  static std::vector<std::string> Reported(const std::vector<v1::JobEvent>& events) {
    std::vector<std::string> reported;
    reported.reserve(events.size());
    for (const v1::JobEvent& event : events) {
      reported.push_back(std::to_string(event.sequence()) + ":" + event.warning().message());
    }
    return reported;
  }

  std::vector<std::string> ReadAll(int64_t after = 0) {
    EventLogReader reader(path_, after);
    const auto events = reader.Read();
    EXPECT_OK(events);
    return Reported(*events);
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

// Stages were texts before they were an enum: such an event is read without its stage.
TEST_F(EventLogTest, ReadsEventsFromBeforeStagesWereAnEnum) {
  v1::JobEvent old;
  v1::JobProgress& progress = *old.mutable_progress();
  progress.set_step(7);
  auto& fields = *progress.GetReflection()->MutableUnknownFields(&progress);
  fields.AddLengthDelimited(1, "reconstruct");
  fields.AddVarint(7, 3);  // num_culled_degenerate
  ASSERT_OK_AND_ASSIGN(auto writer, EventLogWriter::Open(path_));
  ASSERT_OK(writer->Append(old));
  EventLogReader reader(path_);
  ASSERT_OK_AND_ASSIGN(const auto events, reader.Read());
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events.front().progress().step(), 7);
  EXPECT_EQ(events.front().progress().stage(), v1::JOB_STAGE_UNSPECIFIED);
}

TEST_F(EventLogTest, NumbersEventsAcrossWriters) {
  Append({"a", "b"});
  Append({"c"});
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b", "3:c"));
  EXPECT_THAT(ReadAll(/*after=*/2), ElementsAre("3:c"));
}

TEST_F(EventLogTest, SetsTheTimeOfEvents) {
  Append({"a"});
  EventLogReader reader(path_);
  EXPECT_NEAR(reader.Read()->at(0).time().seconds(), time(nullptr), 60);
}

TEST_F(EventLogTest, ReadsWhileTheWriterAppends) {
  EventLogReader reader(path_);
  EXPECT_TRUE(reader.Read()->empty());  // the file does not exist yet
  auto writer = EventLogWriter::Open(path_);
  ASSERT_OK((*writer)->Append(Warning("a")));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("1:a"));
  EXPECT_TRUE(reader.Read()->empty());
  ASSERT_OK((*writer)->Append(Warning("b")));
  ASSERT_OK((*writer)->Append(Warning("c")));
  EXPECT_THAT(Reported(*reader.Read(1)), ElementsAre("2:b"));
  EXPECT_THAT(Reported(*reader.Read(1)), ElementsAre("3:c"));
}

TEST_F(EventLogTest, IgnoresATornTailAndCutsItWhenReopened) {
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

TEST_F(EventLogTest, ReportsAFlippedByteAfterTheEventsBeforeIt) {
  Append({"a"});
  const auto first = static_cast<int64_t>(std::filesystem::file_size(path_));
  Append({"b", "c"});
  Flip(first + 10);
  EventLogReader reader(path_);
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("1:a"));
  EXPECT_STATUS(reader.Read(), absl::StatusCode::kDataLoss, path_.string());
  Append({"d"});
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:d"));
}

TEST_F(EventLogTest, AllocatesNothingForAnAbsurdLength) {
  Append({"a"});
  Flip(3);  // the highest byte of the length: 256 MiB
  EventLogReader reader(path_);
  EXPECT_EQ(reader.Read().status().code(), absl::StatusCode::kDataLoss);
}

// Each attempt continues where the one before it was when the attempt took over.
class AttemptLogTest : public EventLogTest {
 protected:
  std::unique_ptr<EventLogWriter> Open(int64_t fence) {
    auto writer = EventLogWriter::Open(path_, fence);
    EXPECT_OK(writer);
    return std::move(writer).value();
  }
};

TEST_F(AttemptLogTest, ContinuesNumbersAcrossAttempts) {
  Append({"queued"});
  ASSERT_OK(Open(1)->Append(Warning("first")));
  ASSERT_OK(Open(3)->Append(Warning("third")));  // the second wrote nothing
  ASSERT_OK(Open(3)->Append(Warning("third again")));
  EXPECT_THAT(ReadAll(), ElementsAre("1:queued", "2:first", "3:third", "4:third again"));
  EXPECT_THAT(ReadAll(2), ElementsAre("3:third", "4:third again"));
}

TEST_F(AttemptLogTest, IgnoresEventsWrittenAfterALostClaim) {
  const auto stale = Open(1);
  ASSERT_OK(stale->Append(Warning("mine")));
  const auto next = Open(2);
  ASSERT_OK(stale->Append(Warning("stale")));
  ASSERT_OK(next->Append(Warning("next")));
  ASSERT_OK(stale->Append(Warning("stale, too")));
  EXPECT_THAT(ReadAll(), ElementsAre("1:mine", "2:next"));
  EXPECT_EQ(Open(2)->last_sequence(), 2);
  EXPECT_EQ(Open(3)->last_sequence(), 2);
}

TEST_F(AttemptLogTest, ReadsOnInTheNextAttempt) {
  EventLogReader reader(path_);
  ASSERT_OK(Open(1)->Append(Warning("a")));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("1:a"));
  EXPECT_TRUE(reader.Read()->empty());
  ASSERT_OK(Open(2)->Append(Warning("b")));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("2:b"));
  EXPECT_EQ(reader.fence(), 2);
}

TEST_F(AttemptLogTest, ReadsOnInTheNextAttemptAfterABrokenRecord) {
  Append({"a", "b"});
  Flip(static_cast<int64_t>(std::filesystem::file_size(path_)) - 1);
  EventLogReader alone(path_);
  EXPECT_THAT(Reported(*alone.Read()), ElementsAre("1:a"));
  EXPECT_EQ(alone.Read().status().code(), absl::StatusCode::kDataLoss);
  ASSERT_OK(Open(1)->Append(Warning("c")));
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:c"));
}

// A folder in place of a file acts like a file on a bad disk: it opens, but cannot be read.
TEST_F(AttemptLogTest, NeitherSkipsNorCutsWhatCannotBeRead) {
  Append({"a"});
  const std::filesystem::path bad = folder_.path() / "events-1.log";
  std::filesystem::create_directory(bad);
  EventLogReader reader(path_);
  EXPECT_EQ(reader.Read().status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(EventLogWriter::Open(path_, 2).status().code(), absl::StatusCode::kInternal);
  std::filesystem::remove(bad);
  EXPECT_THAT(ReadAll(), ElementsAre("1:a"));
  ASSERT_OK(Open(2)->Append(Warning("b")));
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b"));
}

// The machine died right after the file was created.
TEST_F(AttemptLogTest, IgnoresAFileWithoutItsFirstRecord) {
  Append({"a"});
  std::ofstream(folder_.path() / "events-1.log") << "torn";
  EXPECT_THAT(ReadAll(), ElementsAre("1:a"));
  ASSERT_OK(Open(1)->Append(Warning("b")));
  EXPECT_THAT(ReadAll(), ElementsAre("1:a", "2:b"));
}

// The part of an attempt that its worker writes, even if other code has taken over the worker.
class WorkerEventsTest : public EventLogTest {
 protected:
  WorkerEventsTest() { std::filesystem::create_directories(folder_ / "work"); }

  absl::Status Warn(int64_t fence, EventPart part, const std::string& message) {
    auto writer = EventLogWriter::Open(path_, fence, part);
    return writer.ok() ? (*writer)->Append(Warning(message)) : writer.status();
  }
  // Appends any record to the worker's file.
  void Forge(v1::JobEvent event) {
    const std::string payload = event.SerializeAsString();
    const uint32_t header[2] = {static_cast<uint32_t>(payload.size()), Crc32c(payload)};
    std::ofstream file(work_log_, std::ios::binary | std::ios::app);
    file.write(reinterpret_cast<const char*>(header), sizeof(header));
    file << payload;
  }
  void ForgeFirst(int64_t sequence) {
    v1::JobEvent first;
    first.set_sequence(sequence);
    Forge(first);
  }
  static v1::JobEvent Numbered(v1::JobEvent event, int64_t sequence) {
    event.set_sequence(sequence);
    return event;
  }

  const std::filesystem::path work_log_ = folder_ / "work/events-1.log";
};

TEST_F(WorkerEventsTest, AreReadBetweenThoseOfTheServer) {
  Append({"queued"});
  EXPECT_OK(Warn(1, EventPart::kBefore, "started"));
  EXPECT_OK(Warn(1, EventPart::kWorker, "works"));
  EXPECT_OK(Warn(1, EventPart::kAfter, "ended"));
  EXPECT_OK(Warn(2, EventPart::kBefore, "again"));
  EXPECT_OK(Warn(1, EventPart::kWorker, "stale"));
  EXPECT_OK(Warn(2, EventPart::kWorker, "works"));
  EXPECT_THAT(ReadAll(),
              ElementsAre("1:queued", "2:started", "3:works", "4:ended", "5:again", "6:works"));
  EXPECT_TRUE(std::filesystem::exists(work_log_));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "events-1-end.log"));
}

TEST_F(WorkerEventsTest, AreReadFromPartToPart) {
  EventLogReader reader(path_);
  EXPECT_OK(Warn(1, EventPart::kBefore, "a"));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("1:a"));
  ASSERT_OK_AND_ASSIGN(const auto worker, EventLogWriter::Open(path_, 1, EventPart::kWorker));
  EXPECT_TRUE(reader.Read()->empty());
  EXPECT_OK(worker->Append(Warning("b")));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("2:b"));
  EXPECT_OK(Warn(1, EventPart::kAfter, "c"));
  EXPECT_OK(worker->Append(Warning("stale")));
  EXPECT_THAT(Reported(*reader.Read()), ElementsAre("3:c"));
}

// A server that followed a link there, to append to the file, could be made to truncate any file.
TEST_F(WorkerEventsTest, AreNeitherReadNorWrittenThroughLinks) {
  const std::filesystem::path victim = folder_ / "audit.log";
  for (const bool fifo : {false, true}) {
    for (const char* name : {"events-1.log", "events-1-end.log", "events.log"}) {
      const std::filesystem::path place = folder_ / "work" / name;
      std::filesystem::remove(place);
      std::ofstream(victim) << "who did what";
      if (fifo) {
        ASSERT_EQ(mkfifo(place.c_str(), 0600), 0);
      } else {
        std::filesystem::create_symlink(victim, place);
      }
    }
    EXPECT_OK(Warn(1, EventPart::kBefore, "started"));
    EXPECT_OK(Warn(1, EventPart::kAfter, "ended"));
    EXPECT_EQ(std::filesystem::file_size(victim), 12u);
    EXPECT_THAT(ReadAll(), ElementsAre("1:started", "2:ended"));
    std::filesystem::remove(folder_ / "events-1.log");
    std::filesystem::remove(folder_ / "events-1-end.log");
  }
}

// The server does not write through a link in place of its own files, either.
TEST_F(WorkerEventsTest, RefuseLinksInPlaceOfTheServersFiles) {
  const std::filesystem::path victim = folder_ / "audit.log";
  std::ofstream(victim) << "who did what";
  std::filesystem::create_symlink(victim, folder_ / "events-1.log");
  EXPECT_FALSE(Warn(1, EventPart::kBefore, "started").ok());
  EXPECT_EQ(std::filesystem::file_size(victim), 12u);
}

TEST_F(WorkerEventsTest, CannotReportTheJobsState) {
  EXPECT_OK(Warn(1, EventPart::kBefore, "started"));
  v1::JobEvent done;
  done.mutable_state_changed()->set_state(v1::JOB_STATE_SUCCEEDED);
  ForgeFirst(1);
  Forge(Numbered(Warning("works"), 2));
  Forge(Numbered(done, 3));
  Forge(Numbered(Warning("hidden"), 4));
  EXPECT_OK(Warn(1, EventPart::kAfter, "ended"));
  EXPECT_THAT(ReadAll(), ElementsAre("1:started", "2:works", "3:ended"));
}

TEST_F(WorkerEventsTest, HavePreviewsWithinTheLimitsOnly) {
  v1::JobEvent good;
  v1::JobEvent::Preview& preview = *good.mutable_preview();
  preview.set_step(1);
  preview.set_num_steps(10);
  preview.set_width(kMaxEventSide);
  preview.set_height(1);
  preview.set_jpeg("\xff\xd8\xff" + std::string(kMaxEventJpeg - 3, 'x'));
  std::vector<v1::JobEvent> bad(6, good);
  bad[0].mutable_preview()->set_width(kMaxEventSide + 1);
  bad[1].mutable_preview()->set_height(0);
  bad[2].mutable_preview()->mutable_jpeg()->push_back('x');
  bad[3].mutable_preview()->set_jpeg("<svg/>");
  bad[4].mutable_preview()->set_step(11);
  bad[5].mutable_preview()->set_step(-1);
  ForgeFirst(0);
  Forge(Numbered(good, 1));
  EventLogReader reader(path_);
  ASSERT_OK_AND_ASSIGN(const auto events, reader.Read());
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].preview().jpeg(), preview.jpeg());
  const auto size = std::filesystem::file_size(work_log_);
  for (const v1::JobEvent& event : bad) {
    Forge(Numbered(event, 2));
    EventLogReader again(path_, 1);
    EXPECT_STATUS(again.Read(), absl::StatusCode::kDataLoss, "it is not an event of a worker");
    std::filesystem::resize_file(work_log_, size);
  }
}

TEST_F(WorkerEventsTest, CannotUseUpTheNumbers) {
  const int64_t last = (int64_t{1} << 62) - 1;
  EXPECT_OK(Warn(1, EventPart::kBefore, "started"));
  ForgeFirst(last);
  Forge(Numbered(Warning("far"), last + 1));
  EXPECT_OK(Warn(1, EventPart::kAfter, "ended"));
  EXPECT_THAT(ReadAll(), ElementsAre("1:started", "2:ended"));
  std::filesystem::remove(work_log_);
  std::filesystem::remove(folder_ / "events-1-end.log");
  ForgeFirst(1);
  Forge(Numbered(Warning("far"), last));
  EXPECT_OK(Warn(1, EventPart::kAfter, "ended"));
  EXPECT_THAT(ReadAll(), ElementsAre("1:started", "2:ended"));
}

TEST_F(WorkerEventsTest, HaveTextsCleanedForClients) {
  EXPECT_OK(Warn(1, EventPart::kWorker, "\x1b[2Jno /srv/data/jobs/j1/work/x"));
  EXPECT_OK(Warn(1, EventPart::kWorker, std::string(100'000, 'y')));
  EventLogReader reader(path_);
  const auto events = reader.Read();
  ASSERT_TRUE(events.ok() && events->size() == 2);
  EXPECT_EQ(events->at(0).warning().message(), "?[2Jno x");
  EXPECT_EQ(events->at(1).warning().message().size(), 2048u);
}

}  // namespace
}  // namespace pepeseg
