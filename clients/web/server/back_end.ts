// What all routes of the back end share.
import type { Channel } from './channel';

export interface BackEnd {
  readonly channel: Channel;
}
