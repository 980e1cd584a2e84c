// Jobs on a Slurm cluster of three nodes on this host.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/store/store.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/server/store/test_database.h"
#include "tests/system/stress/slurm_cluster.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdProcess;
using testing::ServiceClient;

class SlurmTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::SlurmCluster::IsInstalled()) {
      GTEST_SKIP() << "needs root and deploy/packages/stress.txt";
    }
    cluster_ = std::make_unique<testing::SlurmCluster>(3);
    database_ = std::make_unique<testing::PostgresqlServer>();
    url_ = database_->NewDatabase();
  }

  std::unique_ptr<PepesegdProcess> Serve(const std::string& name) {
    return std::make_unique<PepesegdProcess>(
        folder_ / "data",
        testing::PepesegdOptions{{"--database=" + url_, "--launcher=slurm", "--lease-seconds=3"},
                                 {cluster_->environment()},
                                 {},
                                 name,
                                 false});
  }

  std::string Train(ServiceClient& client, int num_steps) {
    EXPECT_OK(client.CreateScene("shelf"));
    const auto dataset =
        client.Upload("shelf", testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf"));
    EXPECT_OK(dataset);
    v1::TrainingOptions options;
    options.mutable_import()->set_image_scale(0.25);
    options.mutable_reconstruct()->set_num_steps(num_steps);
    options.mutable_features()->set_num_steps(100);
    (*options.mutable_advanced())["features.num_pixels"] = "300";
    (*options.mutable_advanced())["features.steps_per_chunk"] = "50";
    const auto job = client.Train("shelf", dataset.value_or(""), options);
    EXPECT_OK(job);
    return job.ok() ? job->name() : "";
  }

  template <typename Reached>
  v1::Job WaitFor(ServiceClient& client, const std::string& job, Reached reached) {
    absl::StatusOr<v1::Job> found;
    EXPECT_TRUE(testing::Eventually(
        [&] {
          found = client.GetJob(job);
          return found.ok() && reached(*found);
        },
        absl::Minutes(4)))
        << job;
    return found.value_or(v1::Job());
  }

  static bool Ended(const v1::Job& job) {
    return job.state() != v1::JOB_STATE_QUEUED && job.state() != v1::JOB_STATE_RUNNING;
  }

  JobRecord RowOf(const std::string& job) {
    const auto store = Store::Open(url_);
    EXPECT_OK(store);
    return (*store)->jobs().GetJob(job.substr(5)).value_or(JobRecord());
  }

  const testing::TempFolder folder_;
  std::unique_ptr<testing::SlurmCluster> cluster_;
  std::unique_ptr<testing::PostgresqlServer> database_;
  std::string url_;
};

TEST_F(SlurmTest, ResumesTheJobOfAKilledNodeOnAnother) {
  const auto server = Serve("");
  ServiceClient client(server->channel());
  const std::string job = Train(client, 2500);
  const auto past = [](int64_t step) {
    return [step](const v1::Job& found) {
      return found.stage() == v1::JOB_STAGE_RECONSTRUCT && found.progress().step() > step;
    };
  };
  WaitFor(client, job, past(1200));  // step 1,000 writes a checkpoint
  const std::string node = cluster_->NodeOf("pepeseg-" + job.substr(5));
  ASSERT_NE(node, "");
  cluster_->KillNode(node);
  const v1::Job done = WaitFor(client, job, Ended);
  ASSERT_EQ(done.state(), v1::JOB_STATE_SUCCEEDED) << done.error().message();
  EXPECT_EQ(RowOf(job).fence, 2);
  ASSERT_OK_AND_ASSIGN(const v1::Model model, client.GetModel(done.model()));
  EXPECT_GE(model.metrics().at("resumed_from_step"), 1000);
}

TEST_F(SlurmTest, JobOutlivesItsServer) {
  auto first = Serve("-a");
  const std::string job = [&] {
    ServiceClient client(first->channel());
    const std::string made = Train(client, 1500);
    WaitFor(client, made, [](const v1::Job& found) { return found.progress().step() > 300; });
    return made;
  }();
  first->Kill();
  const auto second = Serve("-b");
  ServiceClient client(second->channel());
  const v1::Job done = WaitFor(client, job, Ended);
  EXPECT_EQ(done.state(), v1::JOB_STATE_SUCCEEDED) << done.error().message();
  EXPECT_EQ(RowOf(job).fence, 1);  // one attempt, followed by two servers
}

TEST_F(SlurmTest, CancelsAJobOnItsNode) {
  const auto server = Serve("");
  ServiceClient client(server->channel());
  const std::string job = Train(client, 100'000);
  WaitFor(client, job, [](const v1::Job& found) { return found.progress().step() > 10; });
  ASSERT_OK(client.CancelJob(job));
  EXPECT_EQ(WaitFor(client, job, Ended).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(cluster_->NodeOf("pepeseg-" + job.substr(5)), "");
}

}  // namespace
}  // namespace pepeseg
