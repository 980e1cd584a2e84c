import { create, toBinary } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { detailOf, errorWith } from '../../contract/error_detail';
import { ErrorInfoSchema } from '../../gen/pepeseg/v1/errors_pb';

test('details of the server are found by their names in google.rpc', () => {
  const detail = {
    reason: 'BUSY',
    field: 'prompt.view',
    resource: 'jobs/17',
    limit: '8 bytes',
    value: '9 bytes',
    retryMs: 1500,
  };
  const error = errorWith(Code.Unavailable, 'busy', detail);
  const types = ['ErrorInfo', 'BadRequest', 'ResourceInfo', 'RetryInfo'];
  expect(error.details.map((packed) => 'type' in packed && packed.type)).toEqual(
    types.map((type) => `google.rpc.${type}`),
  );
  expect(detailOf(error)).toEqual(detail);
});

test('what was not sent is empty', () => {
  expect(detailOf(errorWith(Code.NotFound, 'gone', { reason: 'NOT_FOUND' }))).toEqual({
    reason: 'NOT_FOUND',
    field: '',
    resource: '',
    limit: '',
    value: '',
    retryMs: undefined,
  });
});

test('details of other servers are not ours', () => {
  const error = new ConnectError('no connection', Code.Unavailable);
  expect(detailOf(error)).toBeUndefined();
  const info = create(ErrorInfoSchema, { reason: 'RATE_LIMITED', domain: 'proxy.example' });
  error.details = [{ type: 'google.rpc.ErrorInfo', value: toBinary(ErrorInfoSchema, info) }];
  expect(detailOf(error)).toBeUndefined();
  error.details = [{ type: 'google.rpc.ErrorInfo', value: new Uint8Array([10, 200]) }];
  expect(detailOf(error)).toBeUndefined();
});
