#include "server/access/project_quotas.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/store/error_detail.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

struct ProjectQuotasTest : ::testing::Test {
  ProjectQuotasTest() : store(*Store::Open("sqlite:" + (folder / "db").string())) {}

  const testing::TempFolder folder;
  std::unique_ptr<Store> store;
  const v1::SegmentViewsRequest query;
};

TEST_F(ProjectQuotasTest, PrefersAProjectsOwnValues) {
  store->SetDefaultQuota({1, 2, 3, 4, 5, 6});
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {10, 0, 30, 0, 50, 0}));
  ProjectQuotas quotas(store.get());
  ASSERT_OK_AND_ASSIGN(const Quota quota, quotas.Get("lab"));
  EXPECT_EQ(quota.stored_bytes, 10);
  EXPECT_EQ(quota.open_uploads, 2);
  EXPECT_EQ(quota.queries_per_second, 50);
  EXPECT_EQ(quota.resident_bytes, 6);
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {}));
  quotas.Forget("lab");
  EXPECT_EQ(quotas.Get("lab")->stored_bytes, 1);
}

TEST_F(ProjectQuotasTest, RefusesQueriesBeyondTheRateWithARetryTime) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {0, 0, 0, 0, 4, 0}));
  ProjectQuotas quotas(store.get());
  for (int i = 0; i < 4; ++i) EXPECT_OK(quotas.Admit("lab", query)) << i;
  const absl::Status refused = quotas.Admit("lab", query);
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  const ErrorDetail detail = DetailOf(refused);
  EXPECT_EQ(detail.reason, "QUOTA");
  EXPECT_EQ(detail.field, "queries_per_second");
  EXPECT_EQ(detail.limit, "4");
  ASSERT_TRUE(detail.retry_after.has_value());
  EXPECT_GT(*detail.retry_after, absl::ZeroDuration());
  EXPECT_LE(*detail.retry_after, absl::Milliseconds(251));
  EXPECT_OK(quotas.Admit("lab", v1::GetSceneRequest())) << "not a query";
  EXPECT_OK(quotas.Admit("other", query)) << "has its own rate";
  absl::SleepFor(absl::Milliseconds(260));
  EXPECT_OK(quotas.Admit("lab", query));
  EXPECT_EQ(quotas.QueryRate("lab"), 1);  // 5 in ten seconds, rounded up
}

TEST_F(ProjectQuotasTest, DecidesForKnownCredentialsWithoutTheStore) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {0, 0, 0, 0, 2, 0}));
  ProjectQuotas quotas(store.get());
  EXPECT_FALSE(quotas.AdmitAtOnce("Bearer a", query).has_value()) << "not known yet";
  quotas.Know("Bearer a", "lab", v1::GetSceneRequest());
  EXPECT_FALSE(quotas.AdmitAtOnce("Bearer a", query).has_value()) << "known for other calls only";
  quotas.Know("Bearer a", "lab", query);
  EXPECT_FALSE(quotas.AdmitAtOnce("Bearer b", query).has_value());
  EXPECT_FALSE(quotas.AdmitAtOnce("Bearer a", v1::GetSceneRequest()).has_value()) << "not a query";
  // Takes from the same token bucket as Admit.
  EXPECT_OK(quotas.AdmitAtOnce("Bearer a", query).value());
  EXPECT_OK(quotas.Admit("lab", query));
  EXPECT_TRUE(absl::IsUnavailable(quotas.AdmitAtOnce("Bearer a", query).value()));
  // After a change the quota is read again before it is used.
  quotas.Forget("lab");
  EXPECT_FALSE(quotas.AdmitAtOnce("Bearer a", query).has_value());
  quotas.Know("Bearer a", "lab", query);
  EXPECT_TRUE(quotas.AdmitAtOnce("Bearer a", query).has_value());
  EXPECT_TRUE(testing::Eventually([&] {
    return !quotas.AdmitAtOnce("Bearer a", query).has_value();
  })) << "known too long ago";
}

TEST_F(ProjectQuotasTest, RefusesInMicroseconds) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {0, 0, 0, 0, 1, 0}));
  ProjectQuotas quotas(store.get());
  ASSERT_OK(quotas.Admit("lab", query));
  constexpr int kTimes = 2000;
  int num_refused = 0;
  const absl::Time start = absl::Now();
  for (int i = 0; i < kTimes; ++i) num_refused += quotas.Admit("lab", query).ok() ? 0 : 1;
  const absl::Duration each = (absl::Now() - start) / kTimes;
  EXPECT_GE(num_refused, kTimes - 3);
  EXPECT_LT(each, testing::TimeLimit(absl::Microseconds(100))) << each;
  RecordProperty("microseconds", absl::StrCat(absl::ToDoubleMicroseconds(each)));
}

}  // namespace
}  // namespace pepeseg
