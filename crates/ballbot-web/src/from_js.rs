//! JavaScript values as serde sees them. Unlike the reader of `serde-wasm-bindgen` it notices
//! unknown keys and names the place of a mistake, and it is asked for exactly the type that is
//! wanted, which keeps the module small.

use js_sys::{Array, Object};
use serde::de::value::StringDeserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer,
    MapAccess, SeqAccess, VariantAccess, Visitor,
};
use std::fmt;
use wasm_bindgen::{JsCast, JsValue};

/// Reads a value.
///
/// # Errors
/// The place of the mistake, and what is wrong.
pub fn from_js<T: DeserializeOwned>(value: JsValue) -> Result<T, Mistake> {
    T::deserialize(Node(value))
}

/// Where a value is not what it should be, and why.
#[derive(Debug)]
pub struct Mistake {
    /// Keys from the inside out.
    place: Vec<String>,
    message: String,
}

impl Mistake {
    fn below(mut self, key: &str) -> Self {
        self.place.push(key.to_owned());
        self
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, key) in self.place.iter().rev().enumerate() {
            write!(f, "{}{key}", if i > 0 { "." } else { "" })?;
        }
        let colon = if self.place.is_empty() { "" } else { ": " };
        write!(f, "{colon}{}", self.message)
    }
}

impl std::error::Error for Mistake {}

impl Error for Mistake {
    fn custom<M: fmt::Display>(message: M) -> Self {
        Self {
            place: Vec::new(),
            message: message.to_string(),
        }
    }
}

struct Node(JsValue);

impl Node {
    fn is_absent(&self) -> bool {
        self.0.is_undefined() || self.0.is_null()
    }

    fn expected(&self, what: &str) -> Mistake {
        let found = match (&self.0, self.0.as_f64(), self.0.as_string()) {
            (_, Some(number), _) => format!("the number {number}"),
            (_, _, Some(text)) => format!("the text {text:?}"),
            (value, ..) if value.is_array() => "a list".to_owned(),
            (value, ..) if value.is_object() => "a table".to_owned(),
            _ if self.is_absent() => "nothing".to_owned(),
            _ => "something else".to_owned(),
        };
        Mistake::custom(format!("{what} is expected, {found} is given"))
    }

    fn number(&self) -> Result<f64, Mistake> {
        self.0.as_f64().ok_or_else(|| self.expected("a number"))
    }

    fn whole(&self) -> Result<u64, Mistake> {
        let number = self.number()?;
        if number >= 0.0 && number.fract() == 0.0 && number <= js_sys::Number::MAX_SAFE_INTEGER {
            Ok(number as u64)
        } else {
            Err(self.expected("a whole number from 0 on"))
        }
    }

    fn text(&self) -> Result<String, Mistake> {
        self.0.as_string().ok_or_else(|| self.expected("a text"))
    }

    fn table(self) -> Result<Table, Mistake> {
        if self.0.is_object() && !self.0.is_array() {
            let entries = Object::entries(self.0.unchecked_ref());
            Ok(Table {
                entries: entries.into_iter(),
                waiting: None,
            })
        } else {
            Err(self.expected("a table"))
        }
    }

    fn list(self) -> Result<List, Mistake> {
        if self.0.is_array() {
            Ok(List {
                values: self.0.unchecked_into::<Array>().into_iter(),
                read: 0,
            })
        } else {
            Err(self.expected("a list"))
        }
    }
}

impl<'de> Deserializer<'de> for Node {
    type Error = Mistake;

    /// Only what tells its own type is asked for; a scenario has nothing else.
    fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Mistake> {
        Err(self.expected("a value of known type"))
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        let value = self.0.as_bool();
        visitor.visit_bool(value.ok_or_else(|| self.expected("true or false"))?)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_f64(self.number()?)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_u64(self.whole()?)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_string(self.text()?)
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        self.deserialize_string(visitor)
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        self.deserialize_string(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        if self.is_absent() {
            visitor.visit_none()
        } else {
            visitor.visit_some(self)
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_seq(self.list()?)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let given = self.0.unchecked_ref::<Array>().length();
        if self.0.is_array() && given as usize != length {
            return Err(Mistake::custom(format!(
                "{length} entries are expected, {given} are given"
            )));
        }
        self.deserialize_seq(visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_map(self.table()?)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        self.deserialize_map(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        if let Some(name) = self.0.as_string() {
            return visitor.visit_enum(Choice {
                name,
                content: Node(JsValue::UNDEFINED),
            });
        }
        let mut table = self.table()?;
        match (table.next(), table.next()) {
            (Some((name, content)), None) => visitor.visit_enum(Choice { name, content }),
            _ => Err(Mistake::custom("one choice is expected, as its only key")),
        }
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_unit()
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u128 f32 char bytes byte_buf unit unit_struct tuple_struct
    }
}

struct Table {
    entries: js_sys::ArrayIntoIter,
    waiting: Option<(String, Node)>,
}

impl Table {
    /// The next key that has a value.
    fn next(&mut self) -> Option<(String, Node)> {
        loop {
            let pair: Array = self.entries.next()?.unchecked_into();
            let (key, value) = (pair.get(0), Node(pair.get(1)));
            if !value.is_absent() {
                return Some((key.as_string().unwrap_or_default(), value));
            }
        }
    }
}

impl<'de> MapAccess<'de> for Table {
    type Error = Mistake;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Mistake> {
        self.waiting = self.next();
        let key = self.waiting.as_ref().map(|(key, _)| key.clone());
        let read = |key: String| -> Result<K::Value, Mistake> {
            let key: StringDeserializer<Mistake> = key.into_deserializer();
            seed.deserialize(key)
        };
        key.map(read).transpose()
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Mistake> {
        match self.waiting.take() {
            Some((key, value)) => seed.deserialize(value).map_err(|error| error.below(&key)),
            None => Err(Mistake::custom("a value without its key")),
        }
    }
}

struct List {
    values: js_sys::ArrayIntoIter,
    read: usize,
}

impl<'de> SeqAccess<'de> for List {
    type Error = Mistake;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Mistake> {
        let Some(value) = self.values.next() else {
            return Ok(None);
        };
        let place = self.read;
        self.read += 1;
        let read = seed.deserialize(Node(value));
        read.map(Some)
            .map_err(|error| error.below(&place.to_string()))
    }
}

struct Choice {
    name: String,
    content: Node,
}

impl<'de> EnumAccess<'de> for Choice {
    type Error = Mistake;
    type Variant = Content;

    fn variant_seed<S: DeserializeSeed<'de>>(
        self,
        seed: S,
    ) -> Result<(S::Value, Content), Mistake> {
        let content = Content(self.name.clone(), self.content);
        let name: StringDeserializer<Mistake> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, content))
    }
}

/// What stands behind the name of a choice.
struct Content(String, Node);

impl<'de> VariantAccess<'de> for Content {
    type Error = Mistake;

    fn unit_variant(self) -> Result<(), Mistake> {
        if self.1.is_absent() {
            Ok(())
        } else {
            Err(self.1.expected("nothing more").below(&self.0))
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Mistake> {
        seed.deserialize(self.1)
            .map_err(|error| error.below(&self.0))
    }

    fn tuple_variant<V: Visitor<'de>>(
        self,
        _length: usize,
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        self.1
            .deserialize_seq(visitor)
            .map_err(|error| error.below(&self.0))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        self.1
            .deserialize_map(visitor)
            .map_err(|error| error.below(&self.0))
    }
}
