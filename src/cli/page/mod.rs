//! A page in the browser that shows a picture while it renders: what it asks for and how it is served. [`state`] is shared by
//! the threads that answer requests and the one that renders.

mod answer;
mod door;
mod frame;
mod http;
mod pose;
mod preview;
mod server;
mod state;
mod told;

pub(super) use frame::{Frame, Look};
pub(super) use pose::Pose;
pub(super) use preview::PagePreview;
pub(super) use server::{Page, bind};
pub(super) use state::{Facts, Order, Shared, Wish};
pub(super) use told::own_command;
