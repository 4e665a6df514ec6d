//! JavaScript values as serde sees them. Unlike the reader of `serde-wasm-bindgen` it notices
//! unknown keys and names the place of a mistake. Tables are looked up field by field, in the
//! order of the struct: serde's code for a sequence is a third of that for a map, and a page has
//! to load it.

use js_sys::{Array, Object, Reflect};
use serde::de::value::StringDeserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error, Expected, IntoDeserializer,
    SeqAccess, VariantAccess, Visitor,
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
pub struct Mistake(Box<Place>);

#[derive(Debug)]
struct Place {
    /// Keys from the inside out.
    keys: Vec<String>,
    message: String,
    /// The first entry that a sequence lacks.
    lacks: Option<usize>,
}

impl Mistake {
    /// Names the field that is missing.
    fn naming(mut self, names: &[&str]) -> Self {
        if let Some(name) = self.0.lacks.take().and_then(|place| names.get(place)) {
            self.0.message = format!("missing field `{name}`");
        }
        self
    }

    fn below(mut self, key: &str) -> Self {
        self.0.keys.push(key.to_owned());
        self
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, key) in self.0.keys.iter().rev().enumerate() {
            write!(f, "{}{key}", if i > 0 { "." } else { "" })?;
        }
        let colon = if self.0.keys.is_empty() { "" } else { ": " };
        write!(f, "{colon}{}", self.0.message)
    }
}

impl std::error::Error for Mistake {}

impl Error for Mistake {
    fn custom<M: fmt::Display>(message: M) -> Self {
        Self(Box::new(Place {
            keys: Vec::new(),
            message: message.to_string(),
            lacks: None,
        }))
    }

    fn invalid_length(given: usize, expected: &dyn Expected) -> Self {
        let mut mistake = Self::custom(format!("{expected} is expected"));
        mistake.0.lacks = Some(given);
        mistake
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
            (_, _, Some(text)) => format!("the text `{text}`"),
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

    fn is_table(&self) -> bool {
        self.0.is_object() && !self.0.is_array()
    }

    /// The table with these fields, and no others.
    fn table(self, names: &'static [&'static str]) -> Result<Table, Mistake> {
        if !self.is_table() {
            return Err(self.expected("a table"));
        }
        for key in Object::keys(self.0.unchecked_ref::<Object>()) {
            let key = key.as_string().unwrap_or_default();
            if !names.contains(&key.as_str()) {
                return Err(Mistake::unknown_field(&key, names));
            }
        }
        Ok(Table {
            object: self.0,
            names,
            read: 0,
        })
    }

    fn fields<'de, V: Visitor<'de>>(
        self,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let read = visitor.visit_seq(self.table(names)?);
        read.map_err(|mistake| mistake.naming(names))
    }

    /// A text that is the name of a choice, or a table with that name as its only key.
    fn choice(self) -> Result<Choice, Mistake> {
        if let Some(name) = self.0.as_string() {
            return Ok(Choice {
                name,
                content: Node(JsValue::UNDEFINED),
            });
        }
        if !self.is_table() {
            return Err(self.expected("a table"));
        }
        let entries = Object::entries(self.0.unchecked_ref::<Object>());
        let choice: Array = entries.get(0).unchecked_into();
        match (entries.length(), choice.get(0).as_string()) {
            (1, Some(name)) => Ok(Choice {
                name,
                content: Node(choice.get(1)),
            }),
            _ => Err(Mistake::custom("one choice is expected, as its only key")),
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

    /// A text, or a table as a whole: read field by field, it must be told its fields.
    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        match self.0.as_string() {
            Some(text) => visitor.visit_string(text),
            None => visitor.visit_newtype_struct(self),
        }
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

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        self.fields(fields, visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        visitor.visit_enum(self.choice()?)
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_unit()
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u128 f32 char bytes byte_buf unit unit_struct tuple_struct map
    }
}

/// The fields of a struct in their order.
struct Table {
    object: JsValue,
    names: &'static [&'static str],
    read: usize,
}

impl Table {
    /// The next field; `None` for one that is absent: what that means, the struct says.
    fn next(&mut self) -> Option<(&'static str, Node)> {
        let name = *self.names.get(self.read)?;
        self.read += 1;
        let value = Reflect::get(&self.object, &JsValue::from_str(name));
        let value = Node(value.unwrap_or(JsValue::UNDEFINED));
        (!value.is_absent()).then_some((name, value))
    }
}

impl<'de> SeqAccess<'de> for Table {
    type Error = Mistake;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Mistake> {
        let Some((name, value)) = self.next() else {
            return Ok(None);
        };
        let read = seed.deserialize(value);
        read.map(Some).map_err(|mistake| mistake.below(name))
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
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let content = self.1;
        content
            .fields(fields, visitor)
            .map_err(|error| error.below(&self.0))
    }
}
