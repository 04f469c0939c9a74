//! `#[dispatch]`: hands the function that it stands before to `dispatched!` of `src/base/simd.rs`. Written as that
//! macro's argument, a function would be out of rustfmt's reach.

#![forbid(unsafe_code)]

use proc_macro::{Delimiter, Group, TokenStream, TokenTree};

/// Compiles a function of a `const LEVEL: u8` for each level of vector instructions.
#[proc_macro_attribute]
pub fn dispatch(_: TokenStream, function: TokenStream) -> TokenStream {
    let mut all: TokenStream = "crate::base::simd::dispatched!".parse().expect("a path");
    all.extend([TokenTree::Group(Group::new(Delimiter::Brace, function))]);
    all
}
